// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/articulation.h"

#include <limits>

#include <gtest/gtest.h>

#include "solver/dynamics/implicit_stepper.h"
#include "solver/dynamics/rigid_body.h"
#include "solver/dynamics/spring_net.h"

namespace cellwarp::core
{

namespace
{

/// A net whose unknowns are not displacements but what velocities change by: a step of
/// its places is `scale` times as large.
class NetByVelocity : public SpringNet
{
public:
    using SpringNet::SpringNet;
    double scale = 1.0;

    void add_moved(int place, const Eigen::Vector3d& n, SparseRow& out) const override
    {
        SpringNet::add_moved(place, scale * n, out);
    }
    double linearise(Eigen::VectorXd& gradient, Measure& here) override
    {
        const double at_work = SpringNet::linearise(gradient, here);
        gradient *= scale;
        return scale * at_work;
    }
    double noise_of_forces() const override
    {
        return scale * SpringNet::noise_of_forces();
    }
    double stiffness_of(int unknown) const override
    {
        return scale * scale * SpringNet::stiffness_of(unknown);
    }
    void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const override
    {
        SpringNet::solve(r, g);
        r /= scale * scale;
    }
    double turn(const Eigen::VectorXd& step) const override
    {
        return SpringNet::turn(scale * step);
    }
    void try_step(const Eigen::VectorXd& step, double length) override
    {
        SpringNet::try_step(scale * step, length);
    }
    void try_more(const Eigen::VectorXd& step) override
    {
        SpringNet::try_more(scale * step);
    }
    void add_correction(const Eigen::VectorXd& part, Eigen::VectorXd& out) const override
    {
        Eigen::VectorXd forces = Eigen::VectorXd::Zero(out.size());
        SpringNet::add_correction(scale * part, forces);
        out += scale * forces;
    }
};

/// A plate on two points of a net of three.
template <class Net>
struct PlateOn
{
    RigidBody plate{2.0, {0.2, 0.3, 0.2}};
    Net net{{{0, 0, 0}, {1, 0, 0}, {0.5, 0, 1}},
            Eigen::Vector3d(0.5, 0.5, 0.5),
            {{{0, 1}, 300}, {{1, 2}, 200}, {{2, 0}, 400}}};

    PlateOn()
    {
        plate.state.p = {0.5, 0, 0};
        plate.state.velocity = {0.3, 1, 0};
        plate.spin({0, 0.5, 1});
    }
    Joint joint(int plate_number, double x, int point)
    {
        Joint joint;
        joint.object = {plate_number, 1 - plate_number};
        joint.place = {plate.add_place({x, 0, 0}), point};
        return joint;
    }
};

using PlateOnNet = PlateOn<SpringNet>;

} // namespace

TEST(Articulation, what_joins_pulls_both_alike_and_is_kept)
{
    PlateOnNet scene;
    ImplicitStepper stepper({&scene.plate, &scene.net},
                            {scene.joint(0, -0.5, 0), scene.joint(0, 0.5, 1)});
    const auto momentum = [&]
    {
        Eigen::Vector3d sum = scene.plate.mass() * scene.plate.state.velocity;
        for (int k = 0; k < 3; ++k)
            sum += scene.net.mass(k) * scene.net.velocity.segment<3>(3 * k);
        return sum;
    };
    const Eigen::Vector3d before = momentum();
    double energy = scene.plate.energy().sum + scene.net.energy().sum;
    for (int k = 0; k < 300; ++k)
    {
        const StepReport report = stepper.step(5e-3);
        ASSERT_EQ(report.stop, MotionStop::Converged);
        EXPECT_LT(report.violation, 1e-11);
        const double now = scene.plate.energy().sum + scene.net.energy().sum;
        // The first step makes the net as fast as the plate.
        EXPECT_LE(now, energy * (1.0 + 1e-9));
        energy = now;
    }
    EXPECT_LT((momentum() - before).norm(), 1e-9);
}

TEST(Articulation, gives_the_same_whatever_the_order_of_objects_and_joints)
{
    PlateOnNet a, b;
    ImplicitStepper first({&a.plate, &a.net}, {a.joint(0, -0.5, 0), a.joint(0, 0.5, 1)});
    ImplicitStepper second({&b.net, &b.plate}, {b.joint(1, 0.5, 1), b.joint(1, -0.5, 0)});
    for (int k = 0; k < 50; ++k)
    {
        first.step(5e-3);
        second.step(5e-3);
    }
    EXPECT_LT((a.net.x - b.net.x).norm(), 1e-9);
    EXPECT_LT((a.plate.state.R - b.plate.state.R).norm(), 1e-9);
}

TEST(Articulation, joins_objects_with_unknowns_of_another_kind)
{
    PlateOnNet a;
    PlateOn<NetByVelocity> b;
    b.net.scale = 5e-3;
    ImplicitStepper first({&a.plate, &a.net}, {a.joint(0, -0.5, 0), a.joint(0, 0.5, 1)});
    ImplicitStepper second({&b.plate, &b.net}, {b.joint(0, -0.5, 0), b.joint(0, 0.5, 1)});
    for (int k = 0; k < 50; ++k)
    {
        EXPECT_EQ(first.step(5e-3).stop, MotionStop::Converged);
        EXPECT_EQ(second.step(5e-3).stop, MotionStop::Converged);
    }
    EXPECT_LT((a.net.x - b.net.x).norm(), 1e-8);
    EXPECT_LT((a.plate.state.R - b.plate.state.R).norm(), 1e-8);
}

TEST(Articulation, joints_that_say_the_same_twice_change_nothing)
{
    PlateOnNet a, b;
    const Joint once = a.joint(0, -0.5, 0), of_b = b.joint(0, -0.5, 0);
    ImplicitStepper first({&a.plate, &a.net}, {once});
    ImplicitStepper second({&b.plate, &b.net}, {of_b, of_b});
    for (int k = 0; k < 20; ++k)
    {
        EXPECT_EQ(first.step(5e-3).num_dropped, 0);
        const StepReport report = second.step(5e-3);
        EXPECT_EQ(report.stop, MotionStop::Converged);
        EXPECT_EQ(report.num_dropped, 3);
    }
    EXPECT_LT((a.net.x - b.net.x).norm(), 1e-9);
}

TEST(Articulation, joints_that_contradict_are_told_and_nothing_is_lost)
{
    // Two places of the plate, a metre apart, at one point of the net.
    PlateOnNet scene;
    ImplicitStepper stepper({&scene.plate, &scene.net},
                            {scene.joint(0, -0.5, 0), scene.joint(0, 0.5, 0)});
    const StepReport report = stepper.step(5e-3);
    EXPECT_EQ(report.stop, MotionStop::Contradiction);
    EXPECT_GT(report.violation, 0.1);
    EXPECT_TRUE(scene.net.x.allFinite());
    EXPECT_TRUE(scene.plate.state.p.allFinite());
}

TEST(Articulation, a_step_that_fails_loses_neither_places_nor_velocities)
{
    PlateOnNet scene;
    ImplicitStepper stepper({&scene.plate, &scene.net}, {scene.joint(0, -0.5, 0)});
    for (int k = 0; k < 10; ++k)
        stepper.step(5e-3);
    const RigidBodyState plate = scene.plate.state;
    const Eigen::VectorXd x = scene.net.x, velocity = scene.net.velocity;
    scene.net.gravity = {0, std::numeric_limits<double>::infinity(), 0};
    EXPECT_EQ(stepper.step(5e-3).stop, MotionStop::NotFinite);
    EXPECT_EQ(scene.net.x, x);
    EXPECT_EQ(scene.net.velocity, velocity);
    EXPECT_EQ(scene.plate.state.p, plate.p);
    EXPECT_EQ(scene.plate.state.R, plate.R);
    EXPECT_EQ(scene.plate.state.velocity, plate.velocity);
    scene.net.gravity.setZero();
    EXPECT_EQ(stepper.step(5e-3).stop, MotionStop::Converged);
}

TEST(Articulation, a_frame_is_kept_turned_as_it_was)
{
    RigidBody a(1.0, {0.1, 0.1, 0.1}), b(1.0, {0.2, 0.2, 0.1});
    b.state.p = {1, 0, 0};
    b.state.R = rotation_about(Eigen::Vector3d(1, 1, 0).normalized(), 0.8);
    a.spin({1, 2, 0.5});
    Joint place, frame;
    place.object = frame.object = {0, 1};
    place.place =
        frame.place = {a.add_place({0.5, 0, 0}),
                       b.add_place(b.state.R.transpose() * Eigen::Vector3d(-0.5, 0, 0))};
    frame.kind = Joint::Kind::Frame;
    frame.frame = b.state.R;
    ImplicitStepper stepper({&a, &b}, {place, frame});
    for (int k = 0; k < 200; ++k)
        ASSERT_EQ(stepper.step(5e-3).stop, MotionStop::Converged);
    EXPECT_LT((a.state.R * frame.frame - b.state.R).norm(), 1e-10);
    EXPECT_GT((a.state.R - Eigen::Matrix3d::Identity()).norm(), 0.1);
}

TEST(Articulation, a_distance_is_kept_while_both_turn_about_each_other)
{
    RigidBody a(1.0, {0.1, 0.1, 0.1}), b(3.0, {0.1, 0.1, 0.1});
    b.state.p = {2, 0, 0};
    b.state.velocity = {0, 1, 0};
    Joint rope;
    rope.kind = Joint::Kind::Distance;
    rope.distance = 2.0;
    rope.object = {0, 1};
    rope.place = {a.add_place({0, 0, 0}), b.add_place({0, 0, 0})};
    ImplicitStepper stepper({&a, &b}, {rope});
    for (int k = 0; k < 1000; ++k)
        ASSERT_EQ(stepper.step(5e-3).stop, MotionStop::Converged);
    EXPECT_NEAR((a.state.p - b.state.p).norm(), 2.0, 1e-10);
    EXPECT_LT(
        (a.state.velocity + 3.0 * b.state.velocity - Eigen::Vector3d(0, 3, 0)).norm(),
        1e-9);
}

} // namespace cellwarp::core
