// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/rigid_body.h"

#include <numbers>
#include <random>
#include <stdexcept>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "solver/dynamics/implicit_stepper.h"

namespace cellwarp::core
{

namespace
{

RigidBody some_body()
{
    RigidBody body(2.0, {0.3, 0.5, 0.4});
    body.gravity = {0.1, -9.81, 0.2};
    body.state.R = rotation_about(Eigen::Vector3d(1, 2, 3).normalized(), 0.7);
    body.state.p = {0.3, -0.2, 0.5};
    body.state.velocity = {1, 2, -1};
    body.spin({3, -2, 1});
    return body;
}

double value_at(RigidBody& body, const Eigen::VectorXd& step, int place,
                const Eigen::Vector3d& force)
{
    body.try_step(step, 1.0);
    ArticulableObject::Measure measure;
    body.measure(true, measure);
    return measure.value - force.dot(body.place(place, true));
}

} // namespace

TEST(RigidBody, derivatives_are_those_of_differences_with_and_without_what_presses_it)
{
    std::mt19937 rng(3);
    std::normal_distribution<double> normal;
    for (const Eigen::Vector3d& force :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(40, -30, 20)})
    {
        RigidBody body = some_body();
        const int place = body.add_place({0.1, 0.4, -0.3});
        body.start(0.05);
        body.try_step(Eigen::VectorXd::Constant(6, 0.02), 1.0);
        body.accept(nullptr);
        body.forget_presses();
        body.press(place, force);
        Eigen::VectorXd gradient;
        ArticulableObject::Measure here;
        body.linearise(gradient, here);
        SparseRow moved;
        body.add_moved(place, force, moved);
        for (const auto& [unknown, value] : moved)
            gradient[unknown] -= value;
        int level = 0;
        ASSERT_EQ(body.factorize({}, level).num_negative, 0);
        ASSERT_EQ(level, 0);
        for (int k = 0; k < 5; ++k)
        {
            Eigen::VectorXd step(6), zero = Eigen::VectorXd::Zero(6);
            for (double& x : step)
                x = normal(rng);
            const double h = 1e-4;
            const double ahead = value_at(body, h * step, place, force),
                         behind = value_at(body, -h * step, place, force),
                         middle = value_at(body, zero, place, force);
            EXPECT_NEAR((ahead - behind) / (2.0 * h), gradient.dot(step),
                        1e-5 * gradient.norm());
            // The factor by what it takes the product back to.
            Eigen::VectorXd bent(6), none;
            for (int c = 0; c < 6; ++c)
            {
                Eigen::VectorXd column = Eigen::VectorXd::Unit(6, c);
                body.solve(column, none);
                bent[c] = column.dot(step);
            }
            Eigen::MatrixXd inverse(6, 6);
            for (int c = 0; c < 6; ++c)
            {
                Eigen::VectorXd column = Eigen::VectorXd::Unit(6, c);
                body.solve(column, none);
                inverse.col(c) = column;
            }
            const double second = step.dot(inverse.inverse() * step);
            EXPECT_NEAR((ahead - 2.0 * middle + behind) / (h * h), second,
                        1e-4 * std::abs(second));
        }
    }
}

TEST(RigidBody, that_is_free_keeps_its_momentum_and_never_gains_energy)
{
    RigidBody body = some_body();
    body.gravity.setZero();
    ImplicitStepper stepper({&body});
    const Eigen::Vector3d v = body.state.velocity, spin = body.angular_velocity();
    EXPECT_LT((spin - Eigen::Vector3d(3, -2, 1)).norm(), 1e-14);
    const double begin = body.energy().sum;
    double before = begin;
    for (int k = 0; k < 500; ++k)
    {
        ASSERT_EQ(stepper.step(1e-3).stop, MotionStop::Converged);
        const double now = body.energy().sum;
        EXPECT_LE(now, before * (1.0 + 1e-12));
        before = now;
    }
    EXPECT_GT(before, 0.98 * begin);
    EXPECT_LT((body.state.velocity - v).norm(), 1e-11);
    EXPECT_LT(
        (body.state.R.transpose() * body.state.R - Eigen::Matrix3d::Identity()).norm(),
        1e-13);
}

TEST(RigidBody, is_refused_with_an_inertia_that_no_body_has)
{
    EXPECT_THROW(RigidBody(1.0, {1, 1, 2.1}), std::invalid_argument);
    EXPECT_THROW(RigidBody(1.0, {1, 1, 0}), std::invalid_argument);
    EXPECT_THROW(RigidBody(0.0, {1, 1, 1}), std::invalid_argument);
    EXPECT_NO_THROW(RigidBody(1.0, {1, 1, 2}));
}

TEST(RigidBody, that_is_led_goes_evenly_and_after_a_step_taken_back_again)
{
    RigidBody body(1.0, {1, 1, 1});
    const Eigen::Matrix3d goal = rotation_about({0, 0, 1}, 1.0);
    body.lead(goal, {4, 0, 0}, 0.4);
    EXPECT_TRUE(body.is_driven());
    for (int k = 1; k <= 4; ++k)
    {
        body.start(0.1);
        body.undo(); // before finish(), as where a solve has failed
        body.start(0.1);
        body.finish();
        EXPECT_NEAR(body.state.p.x(), k, 1e-12);
        EXPECT_NEAR(body.state.R(0, 0), std::cos(0.25 * k), 1e-12);
        EXPECT_NEAR(body.state.velocity.x(), 10.0, 1e-9);
    }
    EXPECT_FALSE(body.is_driven());
}

TEST(RigidBody, on_a_hinge_swings_with_the_period_of_its_inertia)
{
    RigidBody hook(1.0, {1, 1, 1}), body(1.0, {0.05, 0.05, 0.05});
    hook.lead(Eigen::Matrix3d::Identity(), {0, 0, 0}, 0.0);
    body.gravity = {0, -9.81, 0};
    const double angle = 0.02;
    body.state.R = rotation_about({0, 0, 1}, angle);
    body.state.p = body.state.R * Eigen::Vector3d(0, -1, 0);
    Joint joint;
    joint.object = {0, 1};
    joint.place = {hook.add_place({0, 0, 0}), body.add_place({0, 1, 0})};
    ImplicitStepper stepper({&hook, &body}, {joint});
    const double step = 5e-4;
    double crossed = 0.0, last = body.state.p.x();
    for (int k = 1; crossed == 0.0 && k < 4000; ++k)
    {
        const StepReport report = stepper.step(step);
        ASSERT_EQ(report.stop, MotionStop::Converged);
        EXPECT_LT(report.violation, 1e-10);
        const double now = body.state.p.x();
        if (last > 0.0 && now <= 0.0)
            crossed = step * (k - now / (now - last));
        last = now;
    }
    const double quarter =
        0.5 * std::numbers::pi * std::sqrt((0.05 + 1.0) / (1.0 * 9.81 * 1.0));
    EXPECT_NEAR(crossed, quarter, 2e-3 * quarter);
}

} // namespace cellwarp::core
