// SPDX-License-Identifier: GPL-3.0-or-later
// Detail that leaves: nodes of a lattice that go to where a coarser one has them, before
// that takes its place. [theory-skeleton 2.4]
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/lattice.h"
#include "solver/flesh/sparse_rows.h"

namespace cellwarp::core
{

struct LeavingNodes
{
    struct Node
    {
        int node = 0;
        NodeShares parents; ///< where the coarser lattice has it; of nodes that stay
    };
    std::vector<Node> nodes; ///< ascending
    /// Cells of the coarser lattice, by nodes of the finer one.
    std::vector<CornerNodes> coarse_cells;
};

/// \p fine gets the nodes of \p coarse that it has not: those outside of its cells, but
/// not of the coarser ones; they come last. Both are lattices of octrees of one shape.
/// \p coarse_cell: of each fine cell, the one that it is or will be a part of.
LeavingNodes let_leave(Lattice& fine, const Lattice& coarse,
                       std::span<const int> coarse_cell);

/// A vector on its way to none: it begins with a speed, and ends without.
struct Fading
{
    Eigen::Vector3d from = Eigen::Vector3d::Zero();  ///< at the begin
    Eigen::Vector3d slope = Eigen::Vector3d::Zero(); ///< d/d time there
    double begin = 0.0, end = 0.0;

    /// The cubic of these values and slopes; nothing from its end on.
    Eigen::Vector3d at(double time) const;
};

} // namespace cellwarp::core
