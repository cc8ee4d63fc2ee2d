// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/spring_net.h"

#include <random>

#include <gtest/gtest.h>

#include "solver/dynamics/implicit_stepper.h"

namespace cellwarp
{

namespace
{

SpringNet crooked_net()
{
    SpringNet net({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.2, 0.3, 1}},
                  Eigen::Vector4d(1, 2, 1, 0.5),
                  {{{0, 1}, 30, 0}, {{1, 2}, 20, 0}, {{2, 3}, 40, 0}, {{3, 0}, 10, 0}});
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
    SpringNet net({{0, 0, 0}, {1, 0, 0}}, Eigen::Vector2d(1e-3, 1e-3),
                  {{{0, 1}, 100, 0}});
    net.x[3] = 0.2;
    net.start(10.0);
    int level = 0;
    EXPECT_EQ(net.factorize({}, level).num_negative, 0);
    EXPECT_GT(level, 0);
}

TEST(SpringNet, points_that_are_held_stay_and_the_others_hang_below)
{
    SpringNet net({{0, 0, 0}, {1, 0, 0}}, Eigen::Vector2d(1, 2), {{{0, 1}, 500, 0}});
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
    SpringNet net({{0, 0, 0}, {0, 0, 0}}, Eigen::Vector2d(1, 1), {{{0, 1}, 100, 0}});
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

} // namespace cellwarp
