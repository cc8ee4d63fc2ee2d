// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/joined/flesh_object.h"

#include <cmath>

#include <gtest/gtest.h>

#include "solver/dynamics/implicit_stepper.h"
#include "solver/dynamics/rigid_body.h"
#include "solver/dynamics/spring_net.h"
#include "tests/support/flesh.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// A bar 3 x 1 x 1 in half cubes.
Flesh bar(FleshLaw law, const Vector3d& gravity, bool is_held)
{
    Lattice lattice = support::bar_lattice(2, 3);
    std::vector<HeldPoint> held;
    if (is_held)
        held =
            support::held_nodes(lattice, [](const Vector3d& x) { return x.x() < 0.1; });
    FleshSettings settings;
    settings.law = law;
    settings.gravity = gravity;
    settings.tolerance = 1e-12;
    return Flesh(std::move(lattice), {{4e4, 0.3, 1000.0}}, std::move(held), {}, settings);
}

/// A point of the flesh as a place.
FleshPoint point_at(const Flesh& flesh, const Vector3d& x)
{
    const Lattice& lattice = flesh.lattice();
    for (int cell = 0; cell < static_cast<int>(lattice.cells.size()); ++cell)
        if (const Vector3d local = *local_place(lattice, cell, x);
            local.minCoeff() >= 0.0 && local.maxCoeff() <= 1.0)
            return {shares_at(lattice, cell, local), x};
    throw std::logic_error("no cell has it");
}

} // namespace

TEST(FleshObject, alone_it_steps_as_flesh_does)
{
    Flesh flesh = bar(FleshLaw::Cells, {0, -9.81, 0}, true);
    FleshState state = flesh.rest(), other = flesh.rest();
    FleshObject object(flesh, state, Motion());
    ImplicitStepper stepper({&object});
    const double dt = 1.0 / 120.0;
    for (int k = 1; k <= 30; ++k)
    {
        Motion turn;
        turn.R = rotation_about({0, 0, 1}, 0.01 * k);
        Motion before;
        before.R = rotation_about({0, 0, 1}, 0.01 * (k - 1));
        object.lead({before}, {turn}, dt);
        EXPECT_EQ(stepper.step(dt).stop, MotionStop::Converged);
        EXPECT_TRUE(flesh.step(other, dt, std::vector{turn}).is_converged);
        EXPECT_LT((state.u - other.u).norm(), 1e-7 * (1.0 + other.u.norm())) << k;
    }
    EXPECT_GT(state.u.norm(), 0.1);
}

TEST(FleshObject, momentum_stays_where_nothing_holds)
{
    // Flesh, a turning body and a net, joined in a row; the flesh's axes are turned
    // against the scene's.
    for (const FleshLaw law : {FleshLaw::Cells, FleshLaw::NeoHookean})
    {
        Flesh flesh = bar(law, Vector3d::Zero(), false);
        FleshState state = flesh.rest();
        Motion to_scene;
        to_scene.R = rotation_about(Vector3d(1, 2, 3).normalized(), 0.8);
        to_scene.t = {0.4, 1.0, -2.0};
        for (Eigen::Index n = 0; n < state.v.size(); n += 3)
            state.v.segment<3>(n) = Vector3d(0.3, 0.1, 0.0);
        FleshObject object(flesh, state, to_scene);
        const Vector3d at = to_scene(Vector3d(3, 0.5, 0.5)),
                       from = to_scene(Vector3d(0, 0.5, 0.5));
        RigidBody body(200.0, {20, 30, 20});
        body.state.p = at + Vector3d(0.5, 0, 0);
        body.spin({0, 2, 1});
        SpringNet net({from, from + Vector3d(0, 1, 0)}, Eigen::Vector2d(50, 80),
                      {{{0, 1}, 5e3}});
        Joint with_body{Joint::Kind::Point,
                        {0, 1},
                        {object.add_place(point_at(flesh, {3, 0.5, 0.5})),
                         body.add_place(Vector3d(-0.5, 0, 0))}};
        Joint with_net{Joint::Kind::Point,
                       {0, 2},
                       {object.add_place(point_at(flesh, {0, 0.5, 0.5})), 0}};
        ImplicitStepper stepper({&object, &body, &net}, {with_body, with_net});
        const auto momentum = [&]() -> Vector3d
        {
            Vector3d sum =
                to_scene.R * flesh.momentum(state) + body.mass() * body.state.velocity;
            for (int k = 0; k < 2; ++k)
                sum += net.mass(k) * net.velocity.segment<3>(3 * k);
            return sum;
        };
        const Vector3d first = momentum();
        EXPECT_GT(first.norm(), 100.0);
        for (int k = 0; k < 60; ++k)
        {
            object.lead({}, {}, 0.01);
            const StepReport report = stepper.step(0.01);
            EXPECT_EQ(report.stop, MotionStop::Converged);
            EXPECT_LT(report.violation, 1e-9);
            EXPECT_LT((momentum() - first).norm(), 1e-8 * first.norm()) << k;
        }
        EXPECT_LT((object.place(0, false) -
                   (body.state.p + body.state.R * Vector3d(-0.5, 0, 0)))
                      .norm(),
                  1e-9);
        EXPECT_GT((to_scene.R * flesh.momentum(state) - first).norm(), 1.0);
    }
}

TEST(FleshObject, carries_the_weight_of_what_hangs_on_it)
{
    // A body of 30 kg hangs on the tip of a cantilever, until both are at rest.
    Flesh flesh = bar(FleshLaw::Cells, Vector3d::Zero(), true);
    FleshState state = flesh.rest();
    FleshObject object(flesh, state, Motion());
    RigidBody body(30.0, {1, 1, 1});
    body.gravity = {0, -9.81, 0};
    body.state.p = {3, 0, 0.5};
    const int tip = object.add_place(point_at(flesh, {3, 0.5, 0.5}));
    const Joint joint{
        Joint::Kind::Point, {0, 1}, {tip, body.add_place(Vector3d(0, 0.5, 0))}};
    Articulation all({&object, &body}, {joint});
    const double step = 10.0; // so long that little is left of inertia
    for (int k = 0; k < 60; ++k)
    {
        object.lead({Motion()}, {Motion()}, step);
        for (ArticulableObject* one : {static_cast<ArticulableObject*>(&object),
                                       static_cast<ArticulableObject*>(&body)})
        {
            one->rest();
            one->start(step);
        }
        const MotionReport report = all.solve({});
        EXPECT_TRUE(is_solved(report.stop));
        object.finish();
        body.finish();
    }
    EXPECT_NEAR(std::abs(all.joint_multipliers()[1]), 30.0 * 9.81, 1e-4);
    // The same as a load on the flesh alone.
    const double sag = object.place(tip, false).y() - 0.5;
    EXPECT_LT(sag, -0.02);
    Eigen::VectorXd load = Eigen::VectorXd::Zero(state.u.size());
    for (const NodeShare& share : point_at(flesh, {3, 0.5, 0.5}).shares)
        load[3 * share.node + 1] -= share.share * 30.0 * 9.81;
    flesh.load(load);
    FleshState loaded = flesh.rest();
    EXPECT_TRUE(flesh.settle(loaded, std::vector{Motion()}).is_converged);
    EXPECT_NEAR(at_point(point_at(flesh, {3, 0.5, 0.5}).shares, loaded.u).y(), sag, 1e-6);
}

TEST(FleshObject, what_bones_hold_is_held_in_joints_too)
{
    // A net's point joined to a node that a bone moves goes where the bone does.
    Flesh flesh = bar(FleshLaw::Cells, Vector3d::Zero(), true);
    FleshState state = flesh.rest();
    FleshObject object(flesh, state, Motion());
    SpringNet net({{0, 0, 0}, {-1, 0, 0}}, Eigen::Vector2d(1, 1), {{{0, 1}, 100}});
    const Joint joint{
        Joint::Kind::Point, {0, 1}, {object.add_place(point_at(flesh, {0, 0, 0})), 0}};
    ImplicitStepper stepper({&object, &net}, {joint});
    Motion shift;
    shift.t = {0.2, 0.1, 0};
    object.lead({Motion()}, {shift}, 0.05);
    const StepReport report = stepper.step(0.05);
    EXPECT_EQ(report.stop, MotionStop::Converged);
    EXPECT_LT((net.point(0) - shift.t).norm(), 1e-9);
}

} // namespace cellwarp::core
