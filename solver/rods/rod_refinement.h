// SPDX-License-Identifier: GPL-3.0-or-later
// Knots that come where a rod bends sharply and go where it no longer does, and cuts. The
// curve, its masses and its momentum stay what they are. [Lenoir04]
#pragma once

#include <map>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "solver/rods/rod_model.h"

namespace cellwarp::core
{

/// A rod in motion, whose parts change together. All must outlive it.
struct MovingRod
{
    Rod& rod;
    RodModel& model;
    RodState& state;
    Eigen::VectorXd& velocity;
};

/// The curve and its velocities stay to the last digit, energies but for what fewer
/// places of quadrature made of them. Throws std::invalid_argument, see
/// Rod::insert_knot().
void insert_knot(const MovingRod& rod, double s);

/// Takes out the knot where \p span begins, if the curve moves by no more than \p
/// tolerance [m], its rest not at all, and its twist by less than kTwist. Momentum stays,
/// angular momentum up to that move; the kinetic energy does not grow. False: it stays.
bool remove_knot(const MovingRod& rod, std::size_t span, double tolerance);

/// Two ends where there was none: pieces that share nothing. What slides stays on its
/// own. Throws std::invalid_argument at an end.
void cut(const MovingRod& rod, double s);

/// How far the tangent turns along a span [rad].
double turn_of(const RodState& state, std::size_t span);

struct RefinementSettings
{
    double insert = 0.5, remove = 0.3; ///< turns of a span [rad]
    double tolerance = 1e-3;           ///< by which the curve may move, of the span
    int calm = 10;                     ///< steps after which a knot may go
    double shortest = 0.0;             ///< span that is still halved [m]; 0: its radius
};

class RodRefinement
{
public:
    explicit RodRefinement(const RefinementSettings& settings) : settings_(settings) {}

    /// After a step: halves the spans that turn by too much, and takes out knots that it
    /// has put in and that nobody needs any more. \p used: parameters where something
    /// holds or touches the rod, ascending. Returns how many knots came and went.
    int refine(const MovingRod& rod, std::span<const double> used);

private:
    RefinementSettings settings_;
    std::map<double, int> calm_; ///< knots that it put in, and for how long they are idle
};

/// Where a rod breaks.
struct BreakingLimits
{
    std::optional<double> curvature; ///< |K| [1/m]
    std::optional<double> force;     ///< stretching it [N]
};

/// The knot nearest to the place where a limit is passed by most, not at an end; nothing:
/// none is.
std::optional<double> breaking_place(const RodState& state, const BreakingLimits& limits);

} // namespace cellwarp::core
