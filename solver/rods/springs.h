// SPDX-License-Identifier: GPL-3.0-or-later
// Stretch and bending of a rod by springs between samples of its curve. springs.cpp has
// the forms. [Lenoir04]
#pragma once

#include <memory>

#include "solver/rods/rod_term.h"

namespace cellwarp
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

} // namespace cellwarp
