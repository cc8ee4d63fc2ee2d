// SPDX-License-Identifier: GPL-3.0-or-later
// Where cells of regions are known to move with them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "solver/cells/constraints.h"

namespace cellwarp::core
{

/// Points of the boxes of a rigid region's cells, which move with it: their corners, and
/// where free cells are glued to the largest of them also middles of edges and of the
/// side. They are where the region ends: within the box as far as Constraint::insets
/// says, on average over the cells that share a corner, an edge or a side. None where
/// the material fills little of the box.
class RegionPoints
{
public:
    /// What tells the points of all boxes apart, wherever they are moved.
    using LatticePoint = std::array<std::int64_t, 3>;
    struct Point
    {
        LatticePoint lattice;
        Eigen::Vector3d at;
        bool is_at_border = false; ///< on a side that free cells are glued to
    };

    RegionPoints(const Cells& cells, std::span<const Constraint> constraints);

    const std::vector<Point>& of(std::size_t cell) const { return points_[cell]; }

private:
    std::vector<std::vector<Point>> points_; ///< of each cell
};

} // namespace cellwarp::core
