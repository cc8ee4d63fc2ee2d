// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <tuple>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/flesh.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;

/// 7 x 1 x 1, three cells thick, held at its begin. Density 1000: gravity is such that
/// density g length / E is \p weight.
struct HangingBar
{
    double weight = 1.0;
    Vector3d down = -Vector3d::UnitY();
    FleshLaw law = FleshLaw::Cells;
    double young = 2e4;

    Flesh flesh() const
    {
        const Lattice lattice = support::bar_lattice(3, 7);
        FleshSettings settings;
        settings.law = law;
        settings.gravity = weight * young / (1000.0 * 7.0) * down;
        return Flesh(
            lattice, {{young, 0.4, 1000.0}},
            support::held_nodes(lattice, [](const Vector3d& x) { return x.x() < 1e-9; }),
            {}, settings);
    }
};

/// The farthest that a node is from where it was.
double largest(const VectorXd& u)
{
    double most = 0.0;
    for (Eigen::Index n = 0; n < u.size(); n += 3)
        most = std::max(most, u.segment<3>(n).norm());
    return most;
}

} // namespace

TEST(FleshSettle, soft_flesh_comes_to_rest_in_its_weight_without_going_astray)
{
    // Damped dynamics takes some 5,000 steps of conjugate gradients to the first two.
    const std::vector<Motion> still(1);
    for (const auto& [weight, down, most_strain, most_steps] :
         {std::tuple{1.0, Vector3d(0, -1, 0), 3.0, 5000},
          {0.2, Vector3d(0, -1, 0), 1.0, 5000},
          {1.0, Vector3d(-1, 0, 0), 3.5, 5000},
          {0.2, Vector3d(-1, 0, 0), 1.0, 15000},
          {1.0, Vector3d(0.3, 0.4, 0.5).normalized(), 3.5, 5000}})
    {
        Flesh flesh = HangingBar{weight, down}.flesh();
        FleshState state = flesh.rest();
        const FleshReport report = flesh.settle(state, still);
        EXPECT_TRUE(report.is_converged) << weight << " " << down.transpose();
        EXPECT_LT(report.cg_steps, most_steps) << weight << " " << down.transpose();
        EXPECT_LT(flesh.largest_strain(state), most_strain);
        EXPECT_TRUE(state.v.isZero(0.0));
        // It stays there: in half a second it would fall by more than a length.
        const VectorXd rest = state.u;
        for (int step = 0; step < 60; ++step)
            flesh.step(state, 1.0 / 120, still);
        EXPECT_LT(largest(state.u - rest), 1e-4) << weight << " " << down.transpose();
    }
}

TEST(FleshSettle, strain_stays_bounded_where_rest_is_not_found)
{
    for (const Vector3d& down : {Vector3d(0, -1, 0), Vector3d(-1, 0, 0)})
        for (const double weight : {10.0, 100.0})
        {
            Flesh flesh = HangingBar{weight, down}.flesh();
            FleshState state = flesh.rest();
            flesh.settle(state, std::vector<Motion>(1));
            EXPECT_LT(flesh.largest_strain(state), 20.0 * weight) << weight;
            EXPECT_LT(largest(state.u), 7.0 * (2.0 + weight)) << weight;
        }
}

TEST(FleshSettle, every_law_finds_a_rest_that_stays)
{
    const std::vector<Motion> still(1);
    for (const FleshLaw law :
         {FleshLaw::Linear, FleshLaw::StVenantKirchhoff, FleshLaw::NeoHookean})
    {
        Flesh flesh = HangingBar{0.2, -Vector3d::UnitY(), law}.flesh();
        FleshState state = flesh.rest();
        EXPECT_TRUE(flesh.settle(state, still).is_converged);
        const VectorXd rest = state.u;
        for (int step = 0; step < 60; ++step)
            flesh.step(state, 1.0 / 120, still);
        EXPECT_LT(largest(state.u - rest), 1e-4 * largest(rest));
    }
}

TEST(FleshSettle, stiff_flesh_is_there_after_a_few_rounds)
{
    Flesh flesh = HangingBar{1e-5}.flesh();
    FleshState state = flesh.rest();
    const FleshReport report = flesh.settle(state, std::vector<Motion>(1));
    EXPECT_TRUE(report.is_converged);
    EXPECT_LE(report.systems, 8);
}

TEST(FleshSettle, damping_changes_nothing_of_where_rest_is)
{
    const std::vector<Motion> still(1);
    FleshSettings settings;
    settings.gravity = {0, -0.1, 0};
    settings.tolerance = 1e-10;
    const Lattice lattice = support::bar_lattice(2, 5);
    VectorXd first;
    for (const double damping : {0.0, 3.0})
    {
        settings.alpha = settings.beta = damping;
        Flesh flesh(
            lattice, {{2e4, 0.4, 1000.0}},
            support::held_nodes(lattice, [](const Vector3d& x) { return x.x() < 1e-9; }),
            {}, settings);
        FleshState state = flesh.rest();
        EXPECT_TRUE(flesh.settle(state, still).is_converged);
        if (first.size() == 0)
            first = state.u;
        else
            EXPECT_TRUE(state.u == first);
    }
}

} // namespace cellwarp::core
