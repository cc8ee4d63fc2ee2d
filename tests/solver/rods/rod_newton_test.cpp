// SPDX-License-Identifier: GPL-3.0-or-later
// Equilibria against exact theory.
#include "solver/rods/rod_newton.h"

#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

/// How far the tip of a cantilever of length 1 sinks under a dead load.
double sinking(int points, double alpha, double slenderness, MotionReport& report)
{
    const Rod rod = support::straight_rod(1.0, points - 3,
                                          support::section_of(slenderness, 1.0, 0.7));
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    support::clamp(model, 0.0);
    const double end = rod.basis().end();
    model.loads.push_back({end, {0, -alpha, 0}, Eigen::Vector3d::Zero()});
    RodState state(rod);
    RodNewton newton(model);
    report = newton.solve(state);
    return -state.at(end).place.y();
}

} // namespace

TEST(RodNewton, bends_a_slender_cantilever_in_one_step_without_locking)
{
    struct Row
    {
        int points;
        double alpha, exact, error;
    };
    // Errors that the theory's prototype measured, at YA L^2 / YI = 1.6e9.
    for (const Row& row : {Row{8, 1, 0.30172077, 4.8e-5},
                           {11, 1, 0.30172077, 5.3e-6},
                           {16, 1, 0.30172077, 5.7e-7},
                           {8, 10, 0.81060902, 1.75e-3},
                           {11, 10, 0.81060902, 2.4e-4},
                           {16, 10, 0.81060902, 2.8e-5}})
    {
        MotionReport report;
        const double w = sinking(row.points, row.alpha, 1.6e9, report);
        EXPECT_EQ(report.stop, MotionStop::Converged);
        EXPECT_LE(report.iterations, 14);
        EXPECT_LT(std::abs(w / row.exact - 1.0), row.error) << row.points;
    }
}

TEST(RodNewton, takes_few_steps_at_any_slenderness)
{
    for (const double slenderness : {1e3, 1e6, 1e9, 1e12})
    {
        MotionReport report;
        sinking(16, 10.0, slenderness, report);
        EXPECT_EQ(report.stop, MotionStop::Converged) << slenderness;
        EXPECT_LE(report.iterations, 14) << slenderness;
    }
}

TEST(RodNewton, an_end_moment_winds_a_rod_to_a_full_circle)
{
    const Rod rod = support::straight_rod(1.0, 24, support::section_of(1e6, 1.0, 0.7));
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    support::clamp(model, 0.0);
    const double end = rod.basis().end();
    model.loads.push_back({end, Eigen::Vector3d::Zero(), {0, 0, 0}});
    RodState state(rod);
    RodNewton newton(model);
    for (int part = 1; part <= 8; ++part)
    {
        model.loads[0].moment.z() = 2.0 * std::numbers::pi * part / 8;
        EXPECT_EQ(newton.solve(state).stop, MotionStop::Converged);
        if (part == 4)
        {
            EXPECT_LT(
                (state.at(end).place - Eigen::Vector3d(0, 2.0 / std::numbers::pi, 0))
                    .norm(),
                2e-4);
        }
    }
    EXPECT_LT(state.at(end).place.norm(), 2e-4);
}

TEST(RodNewton, bends_an_arc_of_45_degrees_out_of_its_plane)
{
    // Without shear; square section of side 1, E = 1e7, nu = 0, GJ = EI.
    const double R = 100.0, young = 1e7, inertia = 1.0 / 12.0;
    std::vector<Eigen::Vector3d> points;
    for (int k = 0; k <= 44; ++k)
    {
        const double a = 0.25 * std::numbers::pi * k / 44;
        points.emplace_back(R * (1.0 - std::cos(a)), R * std::sin(a), 0.0);
    }
    const Rod rod(
        spline_through(points, false, 1),
        [&](double)
        {
            return Section{
                young, {young * inertia, young * inertia}, young * inertia, 1.0, 1.0,
                0.5};
        },
        {});
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    support::clamp(model, 0.0);
    const double end = rod.basis().end();
    model.loads.push_back({end, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()});
    RodState state(rod);
    RodNewton newton(model);
    struct Row
    {
        double force;
        Eigen::Vector3d tip;
    };
    for (const Row& row : {Row{300, {22.245289, 58.780248, 40.189388}},
                           {450, {18.508749, 52.240039, 48.500107}},
                           {600, {15.685356, 47.152150, 53.471763}}})
    {
        model.loads[0].force.z() = row.force;
        EXPECT_EQ(newton.solve(state).stop, MotionStop::Converged);
        EXPECT_LT((state.at(end).place - row.tip).norm(), 2e-2)
            << state.at(end).place.transpose();
    }
}

TEST(RodNewton, meets_contradictory_holds_by_least_squares)
{
    const Rod rod = support::straight_rod(1.0, 8, support::section_of(1e4, 1.0, 0.7));
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    model.gravity = {0, -1, 0};
    support::clamp(model, 0.0);
    support::clamp(model, 0.0);
    RodState state(rod);
    RodNewton newton(model);
    MotionReport report = newton.solve(state);
    EXPECT_EQ(report.stop, MotionStop::Converged);
    EXPECT_EQ(report.num_dropped, 6);
    RodConstraint other;
    other.point = {0, 0.1, 0}; // the same end, elsewhere
    model.constraints.push_back(other);
    report = newton.solve(state);
    EXPECT_EQ(report.stop, MotionStop::Contradiction);
    // Two want it at 0, one at 0.1.
    EXPECT_NEAR(state.at(0.0).place.y(), 0.1 / 3.0, 1e-9);
    EXPECT_NEAR(report.violation, 0.2 / 3.0, 1e-9);
}

} // namespace cellwarp::core
