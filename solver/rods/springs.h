// SPDX-License-Identifier: GPL-3.0-or-later
// Stretch and bending of a rod by springs between samples of its curve. springs.cpp has
// the forms. [Lenoir04]
#pragma once

#include <memory>

#include "solver/dynamics/distance_springs.h"
#include "solver/rods/rod_term.h"

namespace cellwarp::core
{

/// Springs between samples at knots and in the middle of spans: of their distances for
/// stretch, and where springs_bend() of the angles at samples for bending. Twist is not
/// theirs. Bound to this resolution. The rod must outlive it, and be laid out for two
/// successive spans that couple (RodSettings::coupled_spans; else
/// std::invalid_argument).
std::unique_ptr<RodTerm> spring_elasticity(const Rod& rod);

/// Whether springs stand for the rod's bending. Angles know no direction: a rod that is
/// bent at rest, or whose section bends more easily about one direction, needs
/// exact_elasticity() for it.
bool springs_bend(const Rod& rod);

/// A derivative of the curve, of \p order, as a sum of the rod's control points.
PointShares shares_of(const Rod& rod, const BasisValues& values, int order);
/// out += second derivatives of springs between such sums.
void add_second_derivatives(const DistanceSprings& springs, const RodState& state,
                            RodHessian how, BandMatrix& out);

} // namespace cellwarp::core
