// SPDX-License-Identifier: GPL-3.0-or-later
// How the frame of a rod moves the space around it, what holds a rod, and how a rod is
// brought to where holds want it.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "solver/rods/rod.h"
#include "solver/rods/rod_constraint.h"

namespace cellwarp::core
{

/// Where each control point counts most: parameters.
std::vector<double> parameters_of_controls(const SplineBasis& basis);

/// The motion of space that the frame of a rod has made at \p s, from rest.
/// [theory-rods (36)]
Motion carried_by(const RodState& now, const RodState& rest, double s);

/// All rows of what holds a rod.
struct HoldRows
{
    Eigen::MatrixXd by_steps; ///< a row each, of control points and angles
    Eigen::VectorXd violation;
};

HoldRows hold_rows(const RodState& state, std::span<const RodConstraint> holds);

/// Moves \p state to where \p holds have no violation, by as little as that takes.
void bring_to(RodState& state, std::span<const RodConstraint> holds);

/// \p state, moved as the frames of \p to have moved from those of \p from. All are of
/// the rod that lies at \p rest.
RodState moved_along(const RodState& state, const RodState& from, const RodState& to,
                     const RodState& rest);

} // namespace cellwarp::core
