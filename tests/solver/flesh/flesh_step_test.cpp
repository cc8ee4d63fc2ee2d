// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/flesh_step.h"

#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/support/flesh.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;

/// A bar of 3 x 2 x 2 cubes and a half one, held at one end, with a tube in its axis.
struct Bar
{
    Flesh flesh;
    FleshState state;
    std::vector<Motion> motions;

    explicit Bar(FleshLaw law, double beta = 0.01) : flesh(made(law, beta))
    {
        std::mt19937 rng(3);
        std::uniform_real_distribution<double> within(-0.1, 0.1);
        state = flesh.rest();
        for (double& x : state.u)
            x = within(rng);
        for (double& x : state.v)
            x = within(rng);
        Motion turned;
        turned.R = rotation_about({0, 0, 1}, 0.2);
        turned.t = {0.1, -0.05, 0.02};
        motions = {turned};
    }
    static Flesh made(FleshLaw law, double beta)
    {
        const support::Built body =
            support::built(support::box_shape({0, 0, 0}, {3.4, 2, 2}), 4);
        Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
        std::vector<HeldPoint> held =
            support::held_nodes(lattice, [](const Vector3d& x) { return x.x() < 0.1; });
        // A point in the middle of a cell, too: its nodes are bound to each other.
        held.push_back({shares_at(lattice, 0, {0.6, 0.4, 0.3}),
                        cell_point(lattice, 0, {0.6, 0.4, 0.3}), 0});
        const std::vector<FleshMaterial> materials = {{2e3, 0.3, 500.0}};
        const std::vector<TubeBone> bones = {{{{0, 1, 1}, {3, 1, 1}, 0}, 0.6}};
        std::vector<TubePart> tubes =
            tube_parts(lattice, materials, bones, points_in_tubes(lattice, bones), 10.0);
        FleshSettings settings;
        settings.law = law;
        settings.alpha = 0.5;
        settings.beta = law == FleshLaw::Cells || law == FleshLaw::Linear ? beta : 0.0;
        settings.gravity = {0, -9.81, 0};
        settings.tolerance = 1e-12;
        return Flesh(std::move(lattice), materials, std::move(held), std::move(tubes),
                     settings);
    }
};

} // namespace

TEST(FleshStep, gradient_and_second_derivatives_are_those_of_the_value)
{
    for (const FleshLaw law : {FleshLaw::Cells, FleshLaw::Linear,
                               FleshLaw::StVenantKirchhoff, FleshLaw::NeoHookean})
    {
        Bar bar(law);
        FleshStep step(bar.flesh);
        VectorXd u, g, there;
        step.begin(bar.state, 0.02, bar.motions, u);
        step.gradient(u, g);
        ASSERT_EQ(g.size(), Eigen::Index(3 * step.num_free()));
        std::mt19937 rng(5);
        std::normal_distribution<double> normal;
        VectorXd d(g.size());
        for (double& x : d)
            x = normal(rng);
        const double h = 1e-6;
        VectorXd plus, minus, g_plus, g_minus;
        step.move(u, d, h, plus);
        step.move(u, d, -h, minus);
        const double slope = (step.value(plus) - step.value(minus)) / (2 * h);
        EXPECT_NEAR(slope, g.dot(d), 1e-6 * (std::abs(slope) + g.norm()));
        // A x = r: the factor against differences of gradients.
        ASSERT_TRUE(step.factorize(u));
        step.gradient(plus, g_plus);
        step.gradient(minus, g_minus);
        VectorXd r = (g_plus - g_minus) / (2 * h);
        for (Eigen::Index k = 0; k < r.size(); k += 7)
            EXPECT_GT(step.diagonal(k), 0.0);
        step.solve(r);
        // Of large strain second derivatives are made positive: not the same.
        if (law == FleshLaw::Cells || law == FleshLaw::Linear)
            EXPECT_LT((r - d).norm(), 1e-6 * d.norm());
        else
            EXPECT_GT(r.dot(d), 0.0);
    }
}

TEST(FleshStep, its_minimum_is_the_step_of_the_flesh)
{
    for (const FleshLaw law : {FleshLaw::Cells, FleshLaw::Linear})
    {
        Bar bar(law);
        FleshStep step(bar.flesh);
        VectorXd u, g, next;
        step.begin(bar.state, 0.02, bar.motions, u);
        step.gradient(u, g);
        ASSERT_TRUE(step.factorize(u));
        step.solve(g);
        step.move(u, g, -1.0, next);
        const FleshState end = step.end(next);
        const double value = step.value(next);
        EXPECT_LT(value, step.value(u));
        step.gradient(next, g);
        EXPECT_LT(g.norm(), 1e-9 * step.stiffest());
        FleshState state = bar.state;
        EXPECT_TRUE(bar.flesh.step(state, 0.02, bar.motions).is_converged);
        EXPECT_LT((state.u - end.u).norm(), 1e-9 * state.u.norm());
        EXPECT_LT((state.v - end.v).norm(), 1e-8 * state.v.norm());
    }
}

TEST(FleshStep, held_points_are_where_their_motions_have_them)
{
    Bar bar(FleshLaw::Cells);
    FleshStep step(bar.flesh);
    VectorXd u;
    step.begin(bar.state, 0.02, bar.motions, u);
    EXPECT_LT(bar.flesh.largest_miss({u, u}, bar.motions), 1e-13);
}

TEST(FleshStep, blended_regions_are_refused)
{
    Lattice lattice = support::bar_lattice(2, 2);
    FleshRegionShares all;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        all.shares.push_back({static_cast<int>(n), 1.0});
    FleshSettings settings;
    settings.law = FleshLaw::Regions;
    Flesh flesh(std::move(lattice), {FleshMaterial()}, {}, {}, settings, {all});
    EXPECT_THROW(FleshStep{flesh}, std::invalid_argument);
}

} // namespace cellwarp::core
