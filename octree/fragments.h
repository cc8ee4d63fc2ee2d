// SPDX-License-Identifier: GPL-3.0-or-later
// The joining of what should be one piece of material, but whose samples lie apart.
#pragma once

#include "octree/voxel_grid.h"
#include "octree/voxel_values.h"

namespace cellwarp::core
{

/// Adds to the material a ball of radius \p r [voxel] around each of \p marks: a sheet of
/// points becomes connected. (A closing would take off again all that lies between.)
void spread(VoxelGrid& grid, const VoxelFlags& marks, double r);

/// Joins parts of the material that are at most \p reach voxels apart, nearest ones
/// first, by the voxels in between. Samples of one surface may otherwise touch at
/// an edge only, and would not be glued.
void join_fragments(VoxelGrid& grid, int reach);

} // namespace cellwarp::core
