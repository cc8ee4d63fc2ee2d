// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/flesh_contact.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "solver/flesh/flesh.h"
#include "tests/support/flesh.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kStep = 1.0 / 120.0;
const std::vector<Motion> kStill(1);

std::vector<FleshPoint> all_nodes(const Lattice& lattice)
{
    std::vector<FleshPoint> points;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        points.push_back({{{static_cast<int>(n), 1.0}}, lattice.places[n]});
    return points;
}

/// A block of length 2 along x and 1 x 1 across, without bones, above the ground y = 0.
struct Block
{
    Vector3d gravity = {0, -9.81, 0};
    double young = 2e5, alpha = 0.0, tolerance = 1e-10;
    FleshLaw law = FleshLaw::Cells;
    std::vector<HeldPoint> held = {};

    Flesh make() const
    {
        FleshSettings settings;
        settings.law = law;
        settings.alpha = alpha;
        settings.gravity = gravity;
        settings.tolerance = tolerance;
        Flesh flesh(support::bar_lattice(3, 2), {{young, 0.3, 1000.0}}, held, {},
                    settings);
        flesh.set_surface(all_nodes(flesh.lattice()));
        return flesh;
    }
};

FleshObstacle ground(double friction, double height = 0.0)
{
    FleshObstacle plane;
    plane.normal = Vector3d::UnitY();
    plane.offset = height;
    plane.friction = friction;
    return plane;
}

double lowest(const Flesh& flesh, const FleshState& state)
{
    double low = INFINITY;
    for (std::size_t n = 0; n < flesh.lattice().places.size(); ++n)
        low = std::min(low,
                       flesh.lattice().places[n].y() + state.u[Eigen::Index(3 * n + 1)]);
    return low;
}

} // namespace

TEST(FleshContact, gaps_are_those_of_planes_and_spheres)
{
    const FleshObstacle plane = ground(0.0, 0.5);
    EXPECT_NEAR(plane.gap({3, 0.2, 1}).gap, -0.3, 1e-15);
    FleshObstacle ball;
    ball.centre = {1, 0, 0};
    ball.radius = 2.0;
    const FleshObstacle::Gap gap = ball.gap({1, 0, 5});
    EXPECT_NEAR(gap.gap, 3.0, 1e-15);
    EXPECT_LT((gap.normal - Vector3d::UnitZ()).norm(), 1e-15);
    EXPECT_NEAR(ball.gap(ball.centre).gap, -2.0, 1e-15); // some way out
    EXPECT_NEAR(ball.gap(ball.centre).normal.norm(), 1.0, 1e-15);
}

TEST(FleshContact, of_each_node_the_deepest_point_touches)
{
    std::vector<FleshPoint> points = {{{{0, 0.8}, {1, 0.2}}, {0, 0.1, 0}},
                                      {{{0, 0.6}, {1, 0.4}}, {0, -0.1, 0}},
                                      {{{1, 1.0}}, {1, 0.3, 0}},
                                      {{{2, 1.0}}, {2, 4.0, 0}}};
    const FleshSurface surface(points, 3);
    const std::vector<FleshObstacle> obstacles = {ground(0.0), ground(0.0, 0.5)};
    const auto found = surface.candidates(VectorXd::Zero(9), 0.0, obstacles);
    ASSERT_EQ(found.size(), 3u);
    EXPECT_EQ(found[0].obstacle, 0u);
    EXPECT_EQ(found[0].point, 1u);
    EXPECT_NEAR(found[0].gap, -0.1, 1e-15);
    EXPECT_EQ(found[1].obstacle, 1u);
    EXPECT_EQ(found[1].point, 1u);
    EXPECT_EQ(found[2].point, 2u);
    VectorXd u = VectorXd::Zero(9);
    u[7] = -5.0;
    EXPECT_EQ(surface.candidates(u, 0.0, obstacles).size(), 5u);
}

TEST(FleshContact, a_block_comes_to_rest_and_is_carried)
{
    for (const FleshLaw law : {FleshLaw::Cells, FleshLaw::NeoHookean})
        for (const double friction : {0.0, 0.4})
        {
            SCOPED_TRACE(friction);
            Block block;
            block.law = law;
            block.alpha = 6.0;
            Flesh flesh = block.make();
            FleshState state = flesh.rest();
            for (Eigen::Index n = 1; n < state.u.size(); n += 3)
                state.u[n] = 0.05; // it falls
            const std::vector<FleshObstacle> obstacles = {ground(friction)};
            FleshReport report;
            double deepest = 0.0, most = 0.0;
            for (int step = 0; step < 400; ++step)
            {
                report = flesh.step(state, kStep, kStill, {obstacles, {}});
                ASSERT_TRUE(report.is_finite);
                deepest = std::min(deepest, lowest(flesh, state));
                most = std::max(most, report.contacts.force.y());
            }
            EXPECT_GE(deepest, -1e-8);
            const double weight = 2.0 * 1000.0 * 9.81;
            EXPECT_GT(most, 1.5 * weight); // where it hits
            const bool is_even = law == FleshLaw::Cells;
            EXPECT_NEAR(report.contacts.force.y() / weight, 1.0, is_even ? 2e-3 : 3e-2);
            EXPECT_NEAR(report.contacts.force.x() / weight, 0.0, 1e-3);
            EXPECT_EQ(report.contacts.count, 7u * 4u);
            EXPECT_TRUE(report.contacts.is_settled);
            // At rest the sum of all forces is exactly zero.
            FleshReport settled;
            for (int step = 0; step < 40; ++step)
            {
                state.v.setZero();
                settled = flesh.step(state, 30.0, kStill, {obstacles, {}});
            }
            EXPECT_NEAR(settled.contacts.force.y() / weight, 1.0,
                        is_even && friction == 0.0 ? 1e-9 : 1e-6);
        }
}

TEST(FleshContact, it_leaves_when_it_is_lifted)
{
    Flesh flesh = Block().make();
    FleshState state = flesh.rest();
    const std::vector<FleshObstacle> obstacles = {ground(0.5)};
    for (int step = 0; step < 60; ++step)
        flesh.step(state, kStep, kStill, {obstacles, {}});
    VectorXd lift = VectorXd::Zero(state.u.size());
    for (Eigen::Index n = 1; n < lift.size(); n += 3)
        lift[n] = 3.0 * 2.0 * 1000.0 * 9.81 / (double(lift.size()) / 3.0);
    flesh.load(lift);
    FleshReport report;
    for (int step = 0; step < 20; ++step)
        report = flesh.step(state, kStep, kStill, {obstacles, {}});
    EXPECT_EQ(report.contacts.count, 0u);
    EXPECT_EQ(report.contacts.force.norm(), 0.0);
    EXPECT_GT(lowest(flesh, state), 0.01);
}

TEST(FleshContact, on_a_slope_it_sticks_or_slides_as_friction_says)
{
    const double slope = 25.0 * std::numbers::pi / 180.0;
    Block block;
    block.gravity = 9.81 * Vector3d(std::sin(slope), -std::cos(slope), 0);
    block.young = 2e6;
    block.alpha = 4.0;
    for (const double friction : {0.3, 0.7})
    {
        SCOPED_TRACE(friction);
        Flesh flesh = block.make();
        FleshState state = flesh.rest();
        const std::vector<FleshObstacle> obstacles = {ground(friction)};
        for (int step = 0; step < 300; ++step)
            flesh.step(state, kStep, kStill, {obstacles, {}});
        const auto speed = [&] { return flesh.momentum(state).x() / 2000.0; };
        const double before = speed();
        flesh.step(state, kStep, kStill, {obstacles, {}});
        const double wanted =
            std::max(0.0, 9.81 * (std::sin(slope) - friction * std::cos(slope)));
        // Air brakes it.
        EXPECT_NEAR((speed() - before) / kStep + block.alpha * speed(), wanted,
                    2e-3 * 9.81);
        if (wanted == 0.0)
        {
            EXPECT_NEAR(speed(), 0.0, 1e-3);
        }
    }
}

TEST(FleshContact, a_ball_presses_a_dent_and_feels_as_much)
{
    Block block;
    block.gravity.setZero();
    const Lattice lattice = support::bar_lattice(3, 2);
    block.held =
        support::held_nodes(lattice, [](const Vector3d& x) { return x.y() < 1e-9; });
    Flesh flesh = block.make();
    FleshState state = flesh.rest();
    FleshReport report;
    std::vector<FleshObstacle> obstacles(1);
    obstacles[0].radius = 0.8;
    for (int step = 0; step <= 60; ++step)
    {
        const double down = std::min(1.0, step / 40.0) * 0.35;
        obstacles[0].centre = {1, 1.85 - down, 0.5};
        obstacles[0].velocity = {0, step < 40 ? -0.35 * 120 / 40.0 : 0.0, 0};
        report = flesh.step(state, kStep, kStill, {obstacles, {}});
        ASSERT_TRUE(report.contacts.is_settled) << step;
    }
    EXPECT_GT(report.contacts.count, 3u);
    EXPECT_LT(report.contacts.force.y(), -100.0);
    // What the ground gives is what the ball presses: all inner forces sum to zero.
    for (std::size_t n = 0; n < flesh.lattice().places.size(); ++n)
        EXPECT_GT(
            obstacles[0]
                .gap(flesh.lattice().places[n] + state.u.segment<3>(Eigen::Index(3 * n)))
                .gap,
            -2e-3);
    // Mirror images in x and z stay so.
    EXPECT_NEAR(report.contacts.force.x(), 0.0, 1e-6 * report.contacts.force.norm());
    EXPECT_NEAR(report.contacts.force.z(), 0.0, 1e-6 * report.contacts.force.norm());
}

TEST(FleshContact, what_is_pulled_goes_where_it_is_told)
{
    for (const FleshLaw law : {FleshLaw::Cells, FleshLaw::Linear})
    {
        Block block;
        block.gravity.setZero();
        block.law = law;
        block.held = support::held_nodes(support::bar_lattice(3, 2),
                                         [](const Vector3d& x) { return x.x() < 1e-9; });
        Flesh flesh = block.make();
        FleshState state = flesh.rest();
        PulledPoint pulled;
        pulled.point.shares = shares_at(flesh.lattice(), 17, {0.9, 0.3, 0.6});
        pulled.point.place = cell_point(flesh.lattice(), 17, {0.9, 0.3, 0.6});
        pulled.goal = pulled.point.place + Vector3d(0.3, 0.4, -0.1);
        const auto now = [&]
        { return Vector3d(pulled.point.place + at_point(pulled.point.shares, state.u)); };
        const FleshReport report =
            flesh.step(state, kStep, kStill, {{}, std::span(&pulled, 1)});
        EXPECT_LT((now() - pulled.goal).norm(), 1e-10);
        EXPECT_GT(report.contacts.pull.norm(), 1.0);
        // Along a normal alone: the rest is free.
        state = flesh.rest();
        pulled.normal = Vector3d(1, 2, 2) / 3.0;
        flesh.step(state, kStep, kStill, {{}, std::span(&pulled, 1)});
        EXPECT_NEAR(pulled.normal->dot(now() - pulled.goal), 0.0, 1e-10);
        EXPECT_GT((now() - pulled.goal).norm(), 1e-2);
    }
}

TEST(FleshContact, steps_are_the_same_for_any_number_of_threads)
{
    std::vector<VectorXd> ends;
    for (const int threads : {1, 2})
    {
        const ThreadLimit limit(threads);
        Flesh flesh = Block().make();
        FleshState state = flesh.rest();
        const std::vector<FleshObstacle> obstacles = {ground(0.3)};
        for (int step = 0; step < 30; ++step)
            flesh.step(state, kStep, kStill, {obstacles, {}});
        ends.push_back(state.u);
    }
    EXPECT_EQ(ends[0], ends[1]);
}

} // namespace cellwarp::core
