// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/skeleton/joint_limits.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "solver/skeleton/joint_keys.h"

namespace cellwarp::core
{

namespace
{

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

Quaterniond random_turn(std::mt19937& random)
{
    std::normal_distribution<double> number;
    return Quaterniond(number(random), number(random), number(random), number(random))
        .normalized();
}

double swing_angle(const Quaterniond& turn, const Vector3d& axis)
{
    return std::acos(std::clamp((turn * axis).dot(axis), -1.0, 1.0));
}

} // namespace

TEST(JointLimits, turns_within_them_stay_to_the_bit)
{
    JointLimits limits;
    limits.twist = {-kPi, kPi};
    limits.swing = kPi;
    std::mt19937 random(1);
    for (int k = 0; k < 200; ++k)
    {
        const Quaterniond turn = random_turn(random);
        EXPECT_EQ(limited(turn, limits, Vector3d::UnitY()).coeffs(), turn.coeffs());
    }
}

TEST(JointLimits, twist_and_swing_are_cut_at_their_angles)
{
    JointLimits limits;
    limits.twist = {-0.3, 0.8};
    limits.swing = 0.5;
    std::mt19937 random(2);
    const Vector3d axis = Vector3d(1, -2, 0.5).normalized();
    for (int k = 0; k < 1000; ++k)
    {
        const Quaterniond turn = random_turn(random);
        const Quaterniond cut = limited(turn, limits, axis);
        EXPECT_NEAR(cut.norm(), 1.0, 1e-14);
        const double twist = twist_angle(cut, axis);
        EXPECT_GE(twist, -0.3 - 1e-12);
        EXPECT_LE(twist, 0.8 + 1e-12);
        EXPECT_LE(swing_angle(cut, axis), 0.5 + 1e-7);
        // What was not beyond its limit is as it was.
        const double before = twist_angle(turn, axis);
        if (before > -0.3 && before < 0.8)
        {
            EXPECT_NEAR(twist, before, 1e-12);
        }
        if (swing_angle(turn, axis) < 0.5)
        {
            EXPECT_NEAR(swing_angle(cut, axis), swing_angle(turn, axis), 1e-7);
        }
        // Cutting again changes nothing.
        EXPECT_LT(limited(cut, limits, axis).angularDistance(cut), 1e-7);
    }
}

TEST(JointLimits, the_limit_that_is_nearer_on_the_circle_is_taken)
{
    JointLimits limits;
    limits.twist = {-2.0, 0.5};
    const Vector3d axis = Vector3d::UnitZ();
    const auto cut = [&](double angle)
    {
        return twist_angle(limited(Quaterniond(AngleAxisd(angle, axis)), limits, axis),
                           axis);
    };
    EXPECT_NEAR(cut(1.0), 0.5, 1e-15);
    EXPECT_NEAR(cut(-2.5), -2.0, 1e-15);
    EXPECT_NEAR(cut(3.1), -2.0, 1e-15); // 1.18 beyond one end, 2.6 beyond the other
}

TEST(JointLimits, limits_beyond_half_a_turn_hold_what_they_say)
{
    JointLimits limits;
    limits.twist = {0.5, 4.0}; // up to -2.28 as well
    const Vector3d axis = Vector3d::UnitX();
    const Quaterniond inside(AngleAxisd(-2.5, axis));
    EXPECT_EQ(limited(inside, limits, axis).coeffs(), inside.coeffs());
    EXPECT_NEAR(
        twist_angle(limited(Quaterniond(AngleAxisd(0.0, axis)), limits, axis), axis), 0.5,
        1e-15);
}

TEST(JointLimits, limits_may_be_whole_turns_away)
{
    JointLimits limits;
    limits.twist = {800.0 * kPi / 180.0, 1000.0 * kPi / 180.0}; // 80 to 280 degrees
    const Vector3d axis = Vector3d::UnitZ();
    const Quaterniond inside(AngleAxisd(100.0 * kPi / 180.0, axis));
    EXPECT_EQ(limited(inside, limits, axis).coeffs(), inside.coeffs());
    EXPECT_NEAR(
        twist_angle(limited(Quaterniond(AngleAxisd(1.0, axis)), limits, axis), axis),
        80.0 * kPi / 180.0, 1e-12);
}

TEST(JointLimits, a_hinge_keeps_its_twist_alone)
{
    JointLimits limits;
    limits.hinge = Vector3d::UnitX();
    std::mt19937 random(3);
    for (int k = 0; k < 100; ++k)
    {
        const Quaterniond turn = random_turn(random);
        const Quaterniond cut = limited(turn, limits, Vector3d::UnitY());
        EXPECT_LT(cut.vec().tail<2>().norm(), 1e-12);
        EXPECT_NEAR(std::remainder(twist_angle(cut, Vector3d::UnitX()) -
                                       twist_angle(turn, Vector3d::UnitX()),
                                   2.0 * kPi),
                    0.0, 1e-12);
    }
}

TEST(JointLimits, half_a_turn_across_the_axis_has_no_twist)
{
    JointLimits limits;
    limits.swing = 1.0;
    const Quaterniond turn(AngleAxisd(kPi, Vector3d::UnitX()));
    const Quaterniond half(0.0, 1.0, 0.0, 0.0);
    for (const Quaterniond& t : {turn, half})
    {
        const Quaterniond cut = limited(t, limits, Vector3d::UnitZ());
        EXPECT_TRUE(cut.coeffs().allFinite());
        EXPECT_NEAR(swing_angle(cut, Vector3d::UnitZ()), 1.0, 1e-12);
    }
}

} // namespace cellwarp::core
