// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/rod_object.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "solver/dynamics/implicit_stepper.h"
#include "solver/dynamics/rigid_body.h"
#include "solver/rods/elasticity.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

/// A rod that can be joined.
struct Strand
{
    Rod rod;
    RodModel model;
    RodState state;
    Eigen::VectorXd velocity;
    RodObject object;

    explicit Strand(Spline rest,
                    const Section& section = support::section_of(1e5, 0.02, 0.02))
        : rod(std::move(rest), [section](double) { return section; }, {}), model(rod),
          state(rod), velocity(Eigen::VectorXd::Zero(rod.layout().num_unknowns)),
          object((model.terms.push_back(exact_elasticity(rod)), model))
    {
        object.bind(state, velocity);
    }
    Strand(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int spans,
           const Section& section = support::section_of(1e5, 0.02, 0.02))
        : Strand(spline_through(std::vector<Eigen::Vector3d>{a, b}, false, spans),
                 section)
    {
    }
    int add_slide(double share, double friction = 0.0)
    {
        RodSlide slide;
        slide.end = rod.basis().end();
        slide.sticks = slide.slips = friction;
        model.slides.push_back(slide);
        state.sliding.push_back(begun(slide, rod.arc_length().parameter(share)));
        return object.add_sliding_place(static_cast<int>(model.slides.size()) - 1);
    }
    void hold(double share)
    {
        RodConstraint hold;
        hold.s = rod.arc_length().parameter(share);
        hold.point = state.at(hold.s).place;
        model.constraints.push_back(hold);
    }
};

/// A straight wire down from the origin by \p slope [rad], held so often that it stays
/// straight, and a bead on it.
struct BeadOnWire
{
    Strand wire;
    RigidBody bead{0.1, {1e-6, 1e-6, 1e-6}};
    Joint joint;

    BeadOnWire(double slope, double friction, double share = 0.1)
        : wire({0, 0, 0}, 10.0 * Eigen::Vector3d(std::cos(slope), -std::sin(slope), 0),
               40, support::section_of(1e9, 1e6, 1e6))
    {
        for (int k = 0; k <= 40; ++k)
            wire.hold(k / 40.0);
        joint.object = {0, 1};
        joint.place = {wire.add_slide(share, friction), bead.add_place({0, 0, 0})};
        bead.gravity = {0, -9.81, 0};
        bead.state.p = wire.object.place(joint.place[0], false);
    }
    Sliding& sliding() { return wire.state.sliding[0]; }
};

} // namespace

TEST(RodObject, a_bead_slides_down_a_wire_as_friction_lets_it)
{
    // g (sin a - mu cos a), and at 30 degrees it sticks with mu above tan 30 = 0.57735.
    const double slope = std::numbers::pi / 6.0;
    for (const auto& [friction, wanted] :
         {std::pair(0.0, 4.905), {0.3, 2.3562872}, {0.577, 0.0029765}, {0.578, 0.0}})
    {
        SCOPED_TRACE(friction);
        BeadOnWire scene(slope, friction);
        ImplicitStepper stepper({&scene.wire.object, &scene.bead}, {scene.joint});
        const double step = 1e-3;
        const int count = 500;
        for (int k = 0; k < count; ++k)
            ASSERT_EQ(stepper.step(step).stop, MotionStop::Converged);
        // Implicit Euler has gone the way of count (count + 1) / 2 steps.
        const double way = scene.bead.state.p.norm() - 1.0;
        const double a = 2.0 * way / (step * step * count * (count + 1));
        EXPECT_NEAR(a, wanted, 1e-5 + 1e-4 * wanted);
        EXPECT_EQ(scene.sliding().mode == Sliding::Mode::Sticks, friction == 0.578);
    }
}

TEST(RodObject, a_bead_that_is_thrown_comes_to_rest_and_stays)
{
    const double slope = std::numbers::pi / 6.0;
    BeadOnWire scene(slope, 0.8);
    scene.bead.state.velocity =
        2.0 * Eigen::Vector3d(std::cos(slope), -std::sin(slope), 0);
    scene.sliding().mode = Sliding::Mode::Slips;
    scene.sliding().drive = 1.0;
    ImplicitStepper stepper({&scene.wire.object, &scene.bead}, {scene.joint});
    for (int k = 0; k < 4000; ++k)
        ASSERT_EQ(stepper.step(5e-4).stop, MotionStop::Converged);
    EXPECT_EQ(scene.sliding().mode, Sliding::Mode::Sticks);
    EXPECT_NEAR(scene.bead.state.p.norm() - 1.0, 1.0573242, 1e-3);
}

TEST(RodObject, the_rod_and_what_hangs_on_it_pull_each_other_alike)
{
    // Free in space: the sum of both momenta stays.
    Strand rope({0, 0, 0}, {1, 0, 0}, 12);
    RigidBody body(0.5, {0.01, 0.01, 0.01});
    body.state.p = {0.4, 0, 0};
    body.state.velocity = {0.5, 1, 0.2};
    Joint joint;
    joint.object = {0, 1};
    joint.place = {rope.add_slide(0.4), body.add_place({0, 0, 0})};
    ImplicitStepper stepper({&rope.object, &body}, {joint});
    const auto momentum = [&]
    {
        return Eigen::Vector3d(rope.model.mass().momentum(rope.velocity) +
                               body.mass() * body.state.velocity);
    };
    const Eigen::Vector3d before = momentum();
    const double begin = rope.state.sliding[0].s;
    for (int k = 0; k < 300; ++k)
    {
        const StepReport report = stepper.step(1e-3);
        ASSERT_EQ(report.stop, MotionStop::Converged);
        EXPECT_LT(report.violation, 1e-11);
    }
    EXPECT_LT((momentum() - before).norm(), 1e-9);
    EXPECT_GT(rope.state.sliding[0].s - begin, 0.05);
}

TEST(RodObject, ropes_that_cross_slide_along_each_other_both)
{
    Strand a({-1, 0, 0}, {1, 0, 0}, 20), b({0.2, 0, -1}, {0.2, 0, 1}, 20);
    for (Strand* const rope : {&a, &b})
    {
        rope->hold(0.0);
        rope->hold(1.0);
    }
    b.model.gravity = {1.5, -9.81, 0.7};
    Joint joint;
    joint.object = {0, 1};
    joint.place = {a.add_slide(0.6), b.add_slide(0.5)};
    ImplicitStepper stepper({&a.object, &b.object}, {joint});
    for (int k = 0; k < 300; ++k)
        ASSERT_EQ(stepper.step(2e-3).stop, MotionStop::Converged);
    const CurvePoint of_a = a.state.at(a.state.sliding[0].s),
                     of_b = b.state.at(b.state.sliding[0].s);
    EXPECT_LT((of_a.place - of_b.place).norm(), 1e-10);
    EXPECT_GT(std::abs(a.state.sliding[0].s - a.rod.arc_length().parameter(0.6)), 1e-3);
    // Without friction they press across both: the steps are solved for that.
    Articulation all({&a.object, &b.object}, {joint});
    a.object.start(2e-3);
    b.object.start(2e-3);
    ASSERT_EQ(all.solve({}).stop, MotionStop::Converged);
    const Eigen::VectorXd force = all.joint_multipliers();
    EXPECT_GT(force.norm(), 0.1);
    for (const Strand* const rope : {&a, &b})
        EXPECT_LT(std::abs(force.dot(
                      rope->state.at(rope->state.sliding[0].s).first.normalized())),
                  1e-7 * force.norm());
}

TEST(RodObject, a_noose_on_its_own_rope_closes_when_it_is_pulled)
{
    std::vector<Eigen::Vector3d> points = {{-0.5, 0, 0}, {-0.25, 0, 0}, {0, 0, 0}};
    for (int k = 1; k <= 8; ++k)
    {
        const double a = std::numbers::pi * (-0.5 + 2.0 * k / 9.0);
        points.push_back({0.2 * std::cos(a), 0.2 + 0.2 * std::sin(a), 0.02});
    }
    points.push_back({-0.02, 0, 0});
    Strand rope(spline_through(points, false, 2), support::section_of(1e4, 1e-3, 1e-3));
    rope.hold(0.55); // what the noose is round
    Joint joint;
    joint.object = {0, 0};
    joint.place = {rope.object.add_place(rope.rod.basis().end()), rope.add_slide(0.28)};
    rope.model.loads.push_back({0.0, {-2, 0, 0}, {0, 0, 0}});
    rope.model.viscosity = 5.0;
    ImplicitStepper stepper({&rope.object}, {joint});
    double before = rope.state.sliding[0].s;
    const double begin = before;
    for (int k = 0; k < 200; ++k)
    {
        ASSERT_EQ(stepper.step(2e-3).stop, MotionStop::Converged);
        before = rope.state.sliding[0].s;
    }
    EXPECT_GT(before, begin + 0.05);
    EXPECT_LT((rope.state.at(rope.rod.basis().end()).place - rope.state.at(before).place)
                  .norm(),
              1e-10);
}

TEST(RodObject, beads_in_a_row_stay_apart)
{
    // The upper one runs against the lower one, which a stop of its range holds.
    const double slope = std::numbers::pi / 6.0;
    BeadOnWire scene(slope, 0.0, 0.1);
    RigidBody lower(0.1, {1e-6, 1e-6, 1e-6});
    Joint joint;
    joint.object = {0, 2};
    joint.place = {scene.wire.add_slide(0.3), lower.add_place({0, 0, 0})};
    lower.gravity = scene.bead.gravity;
    lower.state.p = scene.wire.object.place(joint.place[0], false);
    scene.wire.model.slides[1].end = scene.wire.rod.arc_length().parameter(0.5);
    scene.wire.model.gaps.push_back({0, 1, 0.4, false});
    scene.wire.state.touches = {0};
    ImplicitStepper stepper({&scene.wire.object, &scene.bead, &lower},
                            {scene.joint, joint});
    for (int k = 0; k < 3000; ++k)
    {
        ASSERT_EQ(stepper.step(1e-3).stop, MotionStop::Converged);
        EXPECT_GT((lower.state.p - scene.bead.state.p).norm(), 0.4 - 1e-6);
    }
    EXPECT_NEAR(lower.state.p.norm(), 5.0, 1e-5);
    EXPECT_NEAR(scene.bead.state.p.norm(), 4.6, 1e-5);
}

TEST(RodObject, a_body_on_two_ropes_hangs_where_weights_balance)
{
    Strand left({-1, 0, 0}, {-0.1, -1, 0}, 12), right({1, 0, 0}, {0.1, -1, 0}, 12);
    RigidBody body(3.0, {0.1, 0.1, 0.1});
    body.state.p = {0, -1, 0};
    body.gravity = {0, -9.81, 0};
    std::vector<Joint> joints;
    int number = 0;
    for (Strand* const rope : {&left, &right})
    {
        rope->hold(0.0);
        Joint joint;
        joint.object = {number, 2};
        joint.place = {rope->object.add_place(rope->rod.basis().end()),
                       body.add_place({number == 0 ? -0.1 : 0.1, 0, 0})};
        joints.push_back(joint);
        ++number;
    }
    ImplicitStepper stepper({&left.object, &right.object, &body}, joints);
    EXPECT_EQ(stepper.settle().stop, MotionStop::Converged);
    EXPECT_NEAR(body.state.p.x(), 0.0, 1e-8);
    EXPECT_LT(body.state.p.y(), -1.0);
    EXPECT_NEAR(body.state.R(0, 0), 1.0, 1e-8);
}

} // namespace cellwarp::core
