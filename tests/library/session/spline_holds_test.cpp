// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/spline_holds.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

std::shared_ptr<const SplineHandle> straight_rod()
{
    SplineStatement statement;
    statement.form = SplineStatement::Form::Through;
    const std::vector<Vector3d> points = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
    return std::make_shared<const SplineHandle>(statement, points, true, 0.1);
}

/// On an arc in the plane of x and z; without \p inner only its end is told.
SplineHolds arc(const SplineHandle& rod, double angle, bool inner)
{
    SplineHolds holds = rod.rest_holds();
    const double radius = 3.0 / angle;
    for (std::size_t k = 1; k < 4; ++k)
    {
        const double turn = angle * static_cast<double>(k) / 3.0;
        holds[k].place = radius * Vector3d(std::sin(turn), 0, 1.0 - std::cos(turn));
        holds[k].parts.place = inner || k == 3;
    }
    holds[3].tangent = Vector3d(std::cos(angle), 0, std::sin(angle));
    holds[3].is_told = true;
    return holds;
}

} // namespace

TEST(SplineHolds, a_told_end_is_framed_by_the_bend_whatever_its_angle)
{
    const auto rod = straight_rod();
    for (const bool inner : {true, false})
        for (const double degrees : {30.0, 179.0, 180.0, 181.0, 270.0})
        {
            const double angle = degrees * kPi / 180.0;
            const HeldLine line = held_line(*rod, arc(*rod, angle, inner));
            EXPECT_FALSE(line.turns_back);
            EXPECT_LT((line.holds[3].carried - rotation_about(Vector3d::UnitY(), -angle))
                          .norm(),
                      1e-9)
                << degrees;
            EXPECT_EQ(line.holds[0].carried, Matrix3d::Identity());
            EXPECT_NEAR(turn_between(*rod, rod->rest_holds(), line.holds), angle, 1e-6);
        }
}

TEST(SplineHolds, an_end_of_which_no_direction_was_told_keeps_its_frame)
{
    const auto rod = straight_rod();
    SplineHolds holds = rod->rest_holds();
    holds[1].parts.place = holds[2].parts.place = true;
    holds[1].place += Vector3d(0, 0.5, 0);
    holds[2].place += Vector3d(0, 0, 0.5);
    const HeldLine line = held_line(*rod, holds);
    EXPECT_EQ(line.holds[3].carried, Matrix3d::Identity());
    // Told, it has no twist against the other end.
    holds[3].is_told = true;
    const HeldLine told = held_line(*rod, holds);
    EXPECT_GT((told.holds[3].carried - Matrix3d::Identity()).norm(), 0.05);
    EXPECT_LT((told.holds[3].carried * Vector3d::UnitX() - Vector3d::UnitX()).norm(),
              1e-12);
    EXPECT_LT((told.turns.back() - told.holds[3].carried).norm(), 1e-12);
}

TEST(SplineHolds, frames_are_carried_from_the_end_that_stays)
{
    const auto rod = straight_rod();
    SplineHolds holds = rod->rest_holds();
    EXPECT_EQ(frame_anchor(*rod, holds), 0u);
    holds[0].is_told = true;
    EXPECT_EQ(frame_anchor(*rod, holds), 3u);
    holds[3].parts.twist = false;
    EXPECT_EQ(frame_anchor(*rod, holds), 0u);
    // The start bent back, the end at rest.
    holds = rod->rest_holds();
    holds[0].is_told = true;
    holds[0].place = Vector3d(3, 0, 2);
    holds[0].tangent = Vector3d(-1, 0, 0);
    const HeldLine line = held_line(*rod, holds);
    EXPECT_EQ(line.holds[3].carried, Matrix3d::Identity());
    EXPECT_LT((line.holds[0].carried - rotation_about(Vector3d::UnitY(), kPi)).norm(),
              1e-9);
}

TEST(SplineHolds, a_way_goes_along_the_bend_and_ends_where_it_is_told)
{
    const auto rod = straight_rod();
    const double angle = 1.5 * kPi;
    const SplineHolds to = held_line(*rod, arc(*rod, angle, true)).holds;
    const HoldWay way(*rod, *rod->rest(), rod->rest_holds(), to);
    EXPECT_EQ(way.at(1.0), to);
    for (const double t : {0.0, 0.25, 0.5, 0.75})
    {
        const SplineHolds now = way.at(t);
        const Vector3d tangent(std::cos(t * angle), 0, std::sin(t * angle));
        EXPECT_LT((now[3].tangent - tangent).norm(), 0.2) << t;
        EXPECT_LT((now[3].carried * Vector3d::UnitX() - now[3].tangent).norm(), 1e-12);
        // The start stays.
        EXPECT_EQ(now[0].carried, Matrix3d::Identity());
        EXPECT_EQ(now[0].tangent, to[0].tangent);
    }
}

} // namespace cellwarp::core
