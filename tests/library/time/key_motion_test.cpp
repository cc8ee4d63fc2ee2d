// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/key_motion.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

MoveKey key(double time, const std::array<double, 4>& rotate)
{
    MoveKey key;
    key.time = time;
    key.move.axis = {rotate[0], rotate[1], rotate[2]};
    key.move.degrees = rotate[3];
    return key;
}

/// The direction of the x axis half way between two keys, at 0 and 1.
Vector3d half_way(const std::array<double, 4>& from, const std::array<double, 4>& to)
{
    return motion_at({key(0, from), key(1, to)}, 0.5, Vector3d::Zero(), 1.0).R *
           Vector3d::UnitX();
}

} // namespace

TEST(KeyMotion, shifts_go_straight_and_turn_nothing)
{
    const auto shifted = [](double time, const Vector3d& by)
    {
        MoveKey key;
        key.time = time;
        key.move.translation = by;
        return key;
    };
    const MoveKeys keys = {shifted(0, {1, 0, 0}), shifted(2, {1, 4, 0})};
    for (const auto& [time, y] :
         {std::pair{-1.0, 0.0}, {0.0, 0.0}, {0.5, 1.0}, {2.0, 4.0}, {3.0, 4.0}})
    {
        const Motion motion = motion_at(keys, time, {5, 6, 7});
        EXPECT_EQ(motion.R, Eigen::Matrix3d::Identity());
        EXPECT_EQ(motion.t, Vector3d(1, y, 0)) << time;
    }
    EXPECT_EQ(motion_at(keys, 2.0, Vector3d::Zero(), 0.5).t, Vector3d(0.5, 2, 0));
    EXPECT_EQ(motion_at({}, 2.0).t, Vector3d::Zero());
}

TEST(KeyMotion, turns_about_one_axis_count_whatever_their_angle)
{
    for (const double degrees : {90.0, 180.0, 270.0, 720.0, -180.0})
    {
        const double half = 0.5 * degrees * std::numbers::pi / 180.0;
        EXPECT_LT((half_way({0, 0, 1, 0}, {0, 0, 1, degrees}) -
                   Vector3d(std::cos(half), std::sin(half), 0))
                      .norm(),
                  1e-12);
    }
}

// From 90 degrees about x to a turn that is half a turn away about z: the signs of the
// keys' quaternions say which way round, and rounding does not.
TEST(KeyMotion, half_a_turn_between_two_axes_goes_as_the_keys_say)
{
    // (x, 90) then (z, 180) is a turn of 180 about (0, 1, 1) / sqrt 2.
    const std::array<double, 4> from = {1, 0, 0, 90};
    for (const double off : {-1e-5, -1e-10, 0.0, 1e-10, 1e-5})
        for (const double sense : {1.0, -1.0})
        {
            const Vector3d x = half_way(from, {0, sense, sense, 180.0 + off});
            EXPECT_LT((x - Vector3d(0, sense, 0)).norm(), 1e-6) << off << " " << sense;
        }
}

TEST(KeyMotion, other_turns_go_the_shortest_way)
{
    // 90 about x, then 100 about y: less than half a turn apart.
    const Vector3d x = half_way({1, 0, 0, 90}, {0, 1, 0, 100});
    EXPECT_GT(x.x(), 0.5);
}

} // namespace cellwarp::core
