// SPDX-License-Identifier: GPL-3.0-or-later
// Rods made by functions, so that a test can be read alone.
#pragma once

#include <numbers>
#include <random>
#include <vector>

#include "solver/rods/elasticity.h"
#include "solver/rods/rod_model.h"

namespace cellwarp::core::support
{

/// Of given stiffnesses, its mass 1 a length.
inline Section section_of(double stretch, double bending, double twist)
{
    return {stretch, {bending, bending}, twist, 1.0, 1e-4, 0.01};
}

/// Along x from the origin, \p spans of equal length.
inline Rod straight_rod(double length, int spans, const Section& section)
{
    const std::vector<Eigen::Vector3d> ends = {{0, 0, 0}, {length, 0, 0}};
    return Rod(spline_through(ends, false, spans), [section](double) { return section; },
               {});
}

/// A circle of \p radius about z.
inline Spline circle(double radius, int points, int degree = 3)
{
    std::vector<Eigen::Vector3d> on;
    for (int k = 0; k < points; ++k)
    {
        const double a = 2.0 * std::numbers::pi * k / points;
        on.emplace_back(radius * std::cos(a), radius * std::sin(a), 0.0);
    }
    return spline_through(on, true, 1, degree);
}

/// Holds place, tangent and twist at a parameter, as they are at rest.
inline void clamp(RodModel& model, double s)
{
    const RodState rest(model.rod());
    const Eigen::Matrix3d frame = rest.frame(s);
    RodConstraint hold;
    hold.s = s;
    hold.point = rest.at(s).place;
    model.constraints.push_back(hold);
    hold.hold = HoldKind::Tangent;
    hold.direction = frame.col(2);
    model.constraints.push_back(hold);
    hold.hold = HoldKind::TwistAngle;
    hold.direction = frame.col(0);
    model.constraints.push_back(hold);
}

inline Eigen::VectorXd random_step(int count, double size, std::mt19937& rng)
{
    std::normal_distribution<double> normal(0.0, size);
    Eigen::VectorXd step(count);
    for (double& x : step)
        x = normal(rng);
    return step;
}

/// A crooked rod of 9 control points, in space.
struct RodCase
{
    bool is_closed, is_round, is_given;
    int degree;
};
Rod crooked_rod(const RodCase& of, const RodSettings& settings);

Eigen::MatrixXd dense(const BandMatrix& H);

/// At a seeded random state of the rod: the gradient is that of differences of the value,
/// the exact second derivatives those of second differences, the definite ones positive.
void expect_derivatives(const RodTerm& term, const Rod& rod);

} // namespace cellwarp::core::support
