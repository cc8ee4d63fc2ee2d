// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/line_bending.h"

#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"

namespace cellwarp::core
{

using support::random_number;
using support::random_rotation;
using support::random_vector;

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr int kCount = 65;

/// A straight line of length 10 along x.
std::vector<LineStation> straight()
{
    std::vector<LineStation> stations;
    for (int k = 0; k < kCount; ++k)
        stations.push_back({double(k), 10.0 * k / (kCount - 1.0), Vector3d::UnitX()});
    return stations;
}

/// The turns of stations on a circle of that angle: each by its share about the axis.
std::vector<Matrix3d> circle(const Vector3d& axis, double angle)
{
    std::vector<Matrix3d> turns;
    for (int k = 0; k < kCount; ++k)
        turns.push_back(rotation_about(axis, angle * k / (kCount - 1.0)));
    return turns;
}

/// A place on an arc in the plane of x and z, as a hold states it.
ToldPlace on_arc(double s, double angle)
{
    ToldPlace told;
    told.s = s;
    told.has_place = true;
    const double radius = 10.0 / angle, turn = angle * s / 10.0;
    told.shift =
        Vector3d(radius * std::sin(turn) - s, 0.0, radius * (1.0 - std::cos(turn)));
    return told;
}

} // namespace

TEST(LineBending, a_circle_of_any_angle_bends_evenly)
{
    std::mt19937 random(1);
    for (const double degrees : {10.0, 179.0, 180.0, 181.0, 270.0, 360.0, 720.0, 1000.0})
    {
        const Vector3d axis = random_vector(random, 1.0).normalized();
        const Matrix3d R = random_rotation(random);
        const double angle = degrees * kPi / 180.0;
        std::vector<Matrix3d> from(kCount, R), to = circle(axis, angle);
        for (Matrix3d& turn : to)
            turn = turn * R;
        const LineBending bending(from, to);
        EXPECT_EQ(bending.at(1.0), to);
        EXPECT_EQ(bending.at(0.0), from);
        for (const double t : {0.25, 0.5, 0.9})
        {
            const std::vector<Matrix3d> now = bending.at(t),
                                        share = circle(axis, t * angle);
            for (std::size_t k = 0; k < now.size(); ++k)
                EXPECT_LT((now[k] - share[k] * R).norm(), 1e-12) << degrees << " " << t;
        }
        EXPECT_NEAR(bending.turns().back(), angle, 1e-9);
        // Looked at in 32 steps, which need not meet half a turn.
        EXPECT_NEAR(bending.largest_turns().back(), std::min(angle, kPi), angle / 64.0);
    }
}

TEST(LineBending, a_line_that_turns_as_a_whole_goes_the_shortest_way)
{
    std::mt19937 random(2);
    for (int trial = 0; trial < 20; ++trial)
    {
        const Vector3d axis = random_vector(random, 1.0).normalized();
        const double angle = random_number(random, 0.1, 3.0);
        const std::vector<Matrix3d> from = circle(Vector3d::UnitY(), 5.0);
        std::vector<Matrix3d> to = from;
        for (Matrix3d& turn : to)
            turn = rotation_about(axis, angle) * turn;
        const std::vector<Matrix3d> now = LineBending(from, to).at(0.5);
        for (std::size_t k = 0; k < now.size(); ++k)
            EXPECT_LT((now[k] - rotation_about(axis, 0.5 * angle) * from[k]).norm(),
                      1e-12);
    }
}

TEST(LineBending, a_line_goes_through_the_places_told_and_in_the_directions_told)
{
    const std::vector<LineStation> rest = straight();
    for (const double degrees : {45.0, 179.0, 180.0, 181.0, 270.0, 360.0})
    {
        const double angle = degrees * kPi / 180.0;
        std::vector<ToldPlace> told;
        for (const double s : {0.0, 2.5, 5.0, 7.5, 10.0})
            told.push_back(on_arc(s, angle));
        told.front().has_direction = told.back().has_direction = true;
        told.front().direction = Vector3d::UnitX();
        told.back().direction = Vector3d(std::cos(angle), 0.0, std::sin(angle));
        const std::vector<Vector3d> directions = directions_as_told(rest, told);
        double worst = 0.0;
        for (std::size_t k = 0; k < rest.size(); ++k)
        {
            const double turn = angle * rest[k].s / 10.0;
            worst = std::max(
                worst,
                (directions[k] - Vector3d(std::cos(turn), 0, std::sin(turn))).norm());
        }
        // A cubic between five places is off by the cube of the angle between two.
        EXPECT_LT(worst, 0.03 * std::max(1.0, std::pow(angle / 4.7, 3))) << degrees;
        const CarriedLine line = carried_along(rest, directions, 0, Matrix3d::Identity());
        EXPECT_FALSE(line.turns_back);
        // In a plane what is carried turns with the line, whatever the angle.
        EXPECT_LT((line.turns.back() - rotation_about(Vector3d::UnitY(), -angle)).norm(),
                  1e-12);
        for (const Matrix3d& turn : line.turns)
            EXPECT_LT((turn * Vector3d::UnitY() - Vector3d::UnitY()).norm(), 1e-12);
    }
}

// Off the axis by 1 / sqrt(1 + c^2) all along, a vector that does not spin turns against
// the curve's own frame by -2 pi c / sqrt(1 + c^2) in a turn.
TEST(LineBending, what_is_carried_along_a_helix_lags_behind_its_own_frame)
{
    constexpr double c = 0.25;
    const double speed = std::sqrt(1.0 + c * c);
    std::vector<LineStation> rest;
    std::vector<Vector3d> directions;
    for (int k = 0; k <= 256; ++k)
    {
        const double t = 2.0 * kPi * k / 256.0;
        rest.push_back({t, speed * t, Vector3d(0, 1, c) / speed});
        directions.push_back(Vector3d(-std::sin(t), std::cos(t), c) / speed);
    }
    const CarriedLine line = carried_along(rest, directions, 0, Matrix3d::Identity());
    const Vector3d normal(-1, 0, 0), carried = line.turns.back() * normal;
    const double angle =
        std::atan2(directions.back().dot(normal.cross(carried)), normal.dot(carried));
    EXPECT_NEAR(angle, -1.5238962757, 2e-4);
    // There and back: nothing is left of it.
    const CarriedLine back =
        carried_along(rest, directions, rest.size() - 1, line.turns.back());
    EXPECT_LT((back.turns.front() - Matrix3d::Identity()).norm(), 1e-9);
}

TEST(LineBending, a_rest_line_that_nothing_moves_carries_its_frames_nowhere)
{
    std::vector<LineStation> rest;
    for (int k = 0; k <= 64; ++k)
    {
        const double t = 0.1 * k;
        rest.push_back(
            {t, t, Vector3d(-std::sin(t), std::cos(t), 0.3 + 0.1 * t).normalized()});
    }
    std::vector<ToldPlace> told(2);
    told[0].has_place = told[1].has_place = true;
    told[1].s = 6.4;
    const CarriedLine line =
        carried_along(rest, directions_as_told(rest, told), 0, Matrix3d::Identity());
    for (const Matrix3d& turn : line.turns)
        EXPECT_LT((turn - Matrix3d::Identity()).norm(), 1e-12);
}

TEST(LineBending, a_line_that_turns_exactly_back_says_so)
{
    const std::vector<LineStation> rest = straight();
    std::vector<ToldPlace> told(2);
    told[0].has_direction = told[1].has_direction = true;
    told[0].direction = Vector3d::UnitX();
    told[1].s = 10.0;
    for (const double off : {0.0, 1e-9, 1e-3})
    {
        told[1].direction = Vector3d(-1, 0, off).normalized();
        const std::vector<Vector3d> directions = directions_as_told(rest, told);
        EXPECT_LT((directions.back() - told[1].direction).norm(), 1e-12);
        const CarriedLine line = carried_along(rest, directions, 0, Matrix3d::Identity());
        EXPECT_EQ(line.turns_back, off < 1e-6);
        EXPECT_LT((line.turns.back() * Vector3d::UnitX() - told[1].direction).norm(),
                  1e-12);
    }
}

TEST(LineBending, the_shortest_turn_to_the_opposite_goes_about_what_is_told)
{
    std::mt19937 random(3);
    for (int trial = 0; trial < 50; ++trial)
    {
        const Vector3d from = random_vector(random, 1.0).normalized(),
                       to = random_vector(random, 1.0).normalized(),
                       across = from.unitOrthogonal();
        EXPECT_LT((shortest_turn(from, to, across) * from - to).norm(), 1e-12);
        const Vector3d axis = from.cross(to).normalized();
        EXPECT_LT((shortest_turn(from, to, across) * axis - axis).norm(), 1e-9);
        const Vector3d back = (-from + 1e-9 * to).normalized();
        EXPECT_TRUE(are_opposite(from, back));
        const Matrix3d half = shortest_turn(from, back, across);
        EXPECT_LT((half * from - back).norm(), 1e-12);
        EXPECT_LT((half * across - across).norm(), 1e-6);
        EXPECT_FALSE(are_opposite(from, from));
    }
}

} // namespace cellwarp::core
