// SPDX-License-Identifier: GPL-3.0-or-later
// Marks the voxels that the surface of a shape touches.
#pragma once

#include "octree/material.h"
#include "octree/voxel_grid.h"

namespace cellwarp
{

/// Marks every voxel that a sample lies in or a triangle touches, also at its rim
/// (conservative): the marks of a connected surface are connected through faces, and
/// a flood through faces cannot leak across them.
void mark_surface(const Shape& shape, VoxelGrid& grid);

} // namespace cellwarp
