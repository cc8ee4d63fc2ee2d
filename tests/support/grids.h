// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "octree/voxel_grid.h"

namespace cellwarp::core::support
{

/// Of cubes of edge 1, each a leaf.
inline VoxelGrid grid_of(const Eigen::Vector3i& counts)
{
    GridShape shape;
    shape.coarsest = counts;
    shape.size = counts.cast<double>();
    shape.voxels_per_leaf = 1;
    return VoxelGrid(shape);
}

} // namespace cellwarp::core::support
