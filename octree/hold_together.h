// SPDX-License-Identifier: GPL-3.0-or-later
// What joins voxels.
#pragma once

#include <algorithm>
#include <cstddef>

#include <Eigen/Core>

#include "octree/notches.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// Whether two voxels side by side are of one material and no open side is between them.
inline bool hold_together(const VoxelGrid& grid, const Notches& notches,
                          const Eigen::Vector3i& a, const Eigen::Vector3i& b)
{
    const std::size_t at_a = grid.index(a), at_b = grid.index(b);
    int axis = 0;
    (b - a).cwiseAbs().maxCoeff(&axis);
    return grid.material()[at_a] == grid.material()[at_b] &&
           !notches.is_open(std::min(at_a, at_b), axis);
}

} // namespace cellwarp::core
