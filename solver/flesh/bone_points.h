// SPDX-License-Identifier: GPL-3.0-or-later
// Where bones hold the material: at their ends, and where they cross from one cell of the
// lattice into the next.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/bound_nodes.h"
#include "solver/flesh/lattice.h"

namespace cellwarp::core
{

/// A straight bone at rest [m].
struct BoneLine
{
    Eigen::Vector3d from, to;
    int motion = 0; ///< number of what moves it
};

/// Whether the material at a point is that of a cell.
using HoldsPoint = std::function<bool(int cell, const Eigen::Vector3d& x)>;

/// Joints first, then along each bone: in an order for bind_nodes(). A joint of several
/// bones comes once. Where a bone runs outside the material it holds nothing.
/// [theory-skeleton 5.1]
std::vector<HeldPoint> points_on_bones(const Lattice& lattice,
                                       std::span<const BoneLine> bones,
                                       const HoldsPoint& holds);

} // namespace cellwarp::core
