// SPDX-License-Identifier: GPL-3.0-or-later
// The inside of soups and clouds: what a flood from outside does not reach once
// their openings are closed.
#pragma once

#include <functional>
#include <optional>

#include "octree/ball_flood.h"
#include "octree/voxel_grid.h"
#include "octree/voxel_values.h"

namespace cellwarp::core
{

/// What marks (not 0) enclose once openings up to a radius are closed: the smallest
/// radius that seals.
class SealedInside
{
public:
    /// Radii up to \p max_radius [voxel], at most BallFlood::kLargest. Keeps the grid and
    /// the marks in sight.
    SealedInside(const VoxelGrid& grid, const VoxelFlags& marks, int max_radius);

    /// That was closed [voxel]; -1: nothing is enclosed.
    int radius() const { return radius_; }
    /// Of each voxel whether it is inside, marks among them: nothing on the outside, and
    /// nothing but what \p may_fill accepts. Gives its memory back.
    VoxelFlags voxels(const std::function<bool(std::size_t)>& may_fill) &&;

private:
    const VoxelGrid& grid_;
    const VoxelFlags& marks_;
    std::optional<BallFlood> flood_;
    int radius_ = -1;
};

} // namespace cellwarp::core
