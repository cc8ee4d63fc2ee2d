// SPDX-License-Identifier: GPL-3.0-or-later
// Which of the voxels that the surface only touches are material.
#pragma once

#include <cstdint>
#include <vector>

#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// Sets the material of \p grid, given the SurfaceMark bits of every voxel and whether it
/// is inside. What the surface reaches into and what is inside is material. A voxel that
/// the surface only touches is so where nothing else would hold the surface together.
void settle_material(VoxelGrid& grid, const VoxelFlags& marks,
                     const VoxelFlags& is_inside);

} // namespace cellwarp::core
