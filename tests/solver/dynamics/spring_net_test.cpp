// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/spring_net.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "solver/dynamics/implicit_stepper.h"

namespace cellwarp::core
{

namespace
{

SpringNet crooked_net()
{
    SpringNet net({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.2, 0.3, 1}},
                  Eigen::Vector4d(1, 2, 1, 0.5),
                  {{{0, 1}, 30}, {{1, 2}, 20}, {{2, 3}, 40}, {{3, 0}, 10}});
    net.gravity = {0, -9.81, 0};
    net.x += 0.2 * Eigen::VectorXd::LinSpaced(12, -1.0, 2.0);
    return net;
}

} // namespace

TEST(SpringNet, gradient_and_second_derivatives_are_those_of_differences)
{
    SpringNet net = crooked_net();
    net.start(0.1);
    Eigen::VectorXd gradient;
    ArticulableObject::Measure measure;
    net.linearise(gradient, measure);
    int level = 0;
    ASSERT_EQ(net.factorize({}, level).num_negative, 0);
    ASSERT_EQ(level, 0);
    std::mt19937 rng(5);
    std::normal_distribution<double> normal;
    const auto value = [&](const Eigen::VectorXd& step)
    {
        net.try_step(step, 1.0);
        net.measure(true, measure);
        return measure.value;
    };
    for (int k = 0; k < 5; ++k)
    {
        Eigen::VectorXd step(12), none;
        for (double& x : step)
            x = normal(rng);
        const double h = 1e-4;
        const double ahead = value(h * step), behind = value(-h * step);
        EXPECT_NEAR((ahead - behind) / (2.0 * h), gradient.dot(step),
                    1e-6 * gradient.norm());
        // A (A^-1 step) = step, with A from differences of values along two directions.
        Eigen::VectorXd back = step;
        net.solve(back, none);
        const double mixed = (value(h * (back + step)) - value(h * (back - step)) -
                              value(h * (step - back)) + value(-h * (back + step))) /
                             (4.0 * h * h);
        EXPECT_NEAR(mixed, step.squaredNorm(), 1e-3 * step.squaredNorm());
    }
}

TEST(SpringNet, that_is_pushed_together_is_made_definite)
{
    SpringNet net({{0, 0, 0}, {1, 0, 0}}, Eigen::Vector2d(1e-3, 1e-3), {{{0, 1}, 100}});
    net.x[3] = 0.2;
    net.start(10.0);
    int level = 0;
    EXPECT_EQ(net.factorize({}, level).num_negative, 0);
    EXPECT_GT(level, 0);
}

TEST(SpringNet, points_that_are_held_stay_and_the_others_hang_below)
{
    SpringNet net({{0, 0, 0}, {1, 0, 0}}, Eigen::Vector2d(1, 2), {{{0, 1}, 500}});
    net.gravity = {0, -9.81, 0};
    net.hold(0);
    ImplicitStepper stepper({&net});
    const StepReport report = stepper.settle();
    EXPECT_EQ(report.stop, MotionStop::Converged);
    EXPECT_EQ(net.point(0), Eigen::Vector3d(0, 0, 0));
    EXPECT_LT((net.point(1) - Eigen::Vector3d(0, -1.0 - 2.0 * 9.81 / 500.0, 0)).norm(),
              1e-7);
}

TEST(SpringNet, a_spring_without_length_pulls_its_points_together)
{
    SpringNet net({{0, 0, 0}, {0, 0, 0}}, Eigen::Vector2d(1, 1), {{{0, 1}, 100}});
    net.velocity << 0, 0, 0, 1, 2, 0;
    ImplicitStepper stepper({&net});
    double farthest = 0.0;
    for (int k = 0; k < 500; ++k)
    {
        ASSERT_EQ(stepper.step(2e-3).stop, MotionStop::Converged);
        farthest = std::max(farthest, (net.point(0) - net.point(1)).norm());
    }
    EXPECT_NEAR(farthest, std::sqrt(5.0 / 200.0), 5e-3);
    EXPECT_LT((net.velocity.head<3>() + net.velocity.tail<3>() - Eigen::Vector3d(1, 2, 0))
                  .norm(),
              1e-9);
}

TEST(SpringNet, never_gains_energy)
{
    SpringNet net = crooked_net();
    ImplicitStepper stepper({&net});
    double before = net.energy().sum;
    for (int k = 0; k < 200; ++k)
    {
        ASSERT_EQ(stepper.step(0.02).stop, MotionStop::Converged);
        const double now = net.energy().sum;
        EXPECT_LE(now, before + 1e-9);
        before = now;
    }
}

TEST(SpringNet, damped_springs_take_the_energy_of_their_swing_and_none_of_a_turn)
{
    // Two points of 2 kg swing against each other with omega^2 = 2 k / m.
    const double k = 100.0, omega = std::sqrt(2.0 * k / 2.0), beta = 0.02, step = 1e-3;
    const auto energy_after =
        [&](double damping, const Eigen::Vector3d& velocity, double time)
    {
        SpringNet net({{0, 0, 0}, {1, 0, 0}}, Eigen::Vector2d(2, 2), {{{0, 1}, k}});
        net.damping = damping;
        net.velocity.head<3>() = velocity;
        net.velocity.tail<3>() = -velocity;
        ImplicitStepper stepper({&net}, {});
        const int count = static_cast<int>(std::lround(time / step));
        for (int n = 0; n < count; ++n)
            EXPECT_EQ(stepper.step(step).stop, MotionStop::Converged);
        return net.energy().sum / (2.0 * velocity.squaredNorm());
    };
    // After two half-swings, each of pi / omega.
    const double time = 2.0 * std::numbers::pi / omega;
    EXPECT_NEAR(-std::log(energy_after(beta, {1e-4, 0, 0}, time)) /
                    (beta * omega * omega * time),
                1.0, 0.01);
    EXPECT_NEAR(energy_after(1.0, {0, 1e-3, 0}, time),
                energy_after(0.0, {0, 1e-3, 0}, time), 1e-5);
}

} // namespace cellwarp::core
