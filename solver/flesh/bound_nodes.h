// SPDX-License-Identifier: GPL-3.0-or-later
// Nodes that are not free: those that hang, and those that points held by bones take. A
// held point is one equation; it is solved for one of its nodes.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/sparse_rows.h"

namespace cellwarp::core
{

/// A point of the material that moves as it is told.
struct HeldPoint
{
    NodeShares shares; ///< of nodes that do not hang; their sum is 1
    Eigen::Vector3d place = Eigen::Vector3d::Zero(); ///< at rest [m]
    int motion = 0; ///< which of the motions that a step is given moves it
};

/// u of a bound node = by_free u + by_points gamma, with gamma the displacements of the
/// held points; the same along each axis.
struct BoundNodes
{
    std::vector<int> free;    ///< nodes, ascending
    std::vector<int> bound;   ///< nodes, ascending
    SparseRows by_free;       ///< of each bound node; columns are places in `free`
    SparseRows free_of;       ///< by_free transposed
    SparseRows by_points;     ///< of each bound node; columns are points
    std::vector<int> dropped; ///< points that hold nothing: others nearly tell the same
};

/// Points in the order of their rank: the first ones hold exactly, a later one is dropped
/// where those before it leave its equation nothing of at least 0.2 to be solved for.
/// [theory-skeleton 5.1] \p hanging: as Lattice has it.
BoundNodes bind_nodes(std::span<const NodeShares> hanging,
                      std::span<const HeldPoint> points);

/// Rows of all nodes: by_free of a bound one, and a free one by itself.
SparseRows by_free_of_all(const BoundNodes& nodes);

} // namespace cellwarp::core
