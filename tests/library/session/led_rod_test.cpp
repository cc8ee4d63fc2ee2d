// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/led_rod.h"

#include <numbers>

#include <gtest/gtest.h>

#include "library/session/spline_holds.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

SplineStatement straight()
{
    SplineStatement statement;
    statement.form = SplineStatement::Form::Through;
    return statement;
}

const std::vector<Vector3d> kPoints = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};

/// All of a rod turned by 120 degrees about its begin and moved.
std::shared_ptr<const SplineState> turned(const SplineHandle& rod)
{
    std::shared_ptr<const SplineState> state = rod.rest();
    for (int part = 1; part <= 6 && state; ++part)
    {
        SplineHolds holds = rod.rest_holds();
        const Eigen::Matrix3d R =
            rotation_about(Vector3d::UnitZ(), part * std::numbers::pi / 9);
        for (SplineHold& hold : holds)
        {
            hold.place = R * hold.place + Vector3d(0, 0, 0.5 * part);
            hold.tangent = R * hold.tangent;
            hold.is_told = true;
        }
        state = rod.moved(*state, held_line(rod, holds).holds, true);
    }
    return state;
}

} // namespace

TEST(LedRod, is_on_the_way_where_each_place_has_gone_its_share)
{
    const auto rod = std::make_shared<const SplineHandle>(straight(), kPoints, true, 0.1);
    const std::shared_ptr<const SplineState> to = turned(*rod);
    ASSERT_TRUE(to);
    EXPECT_EQ(on_the_way(*rod, rod->rest(), to, 1.0), to);
    const std::shared_ptr<const SplineState> half =
        on_the_way(*rod, rod->rest(), to, 0.5);
    for (const double share : {0.0, 0.3, 1.0})
    {
        const double s = rod->parameter_of_share(share);
        const Vector3d rest = rod->rest()->at(s).place, end = to->at(s).place;
        EXPECT_LT((half->at(s).place - 0.5 * (rest + end)).norm(), 1e-12);
        EXPECT_LT((half->carry(s)(rest) - half->at(s).place).norm(), 1e-12);
        // Half of 120 degrees.
        EXPECT_LT(
            (half->carry(s).R - rotation_about(Vector3d::UnitZ(), std::numbers::pi / 3))
                .norm(),
            1e-6);
    }
    // 120 degrees in parts of 45.
    EXPECT_EQ(parts_between(*rod, *rod->rest(), *to, 1e9), 3);
    EXPECT_EQ(parts_between(*rod, *rod->rest(), *rod->rest(), 1.0), 1);
    // The far end goes sqrt(12 + 9) lengths.
    EXPECT_EQ(parts_between(*rod, *rod->rest(), *to, 1.0), 19);
}

// A ring is bent by a whole turn: frames that lie next to each other at its seam do not
// keep still on the way.
TEST(LedRod, bends_evenly_to_a_ring)
{
    const auto rod = std::make_shared<const SplineHandle>(straight(), kPoints, true, 0.1);
    class Ring final : public LedState
    {
    public:
        RailPlace at(double s) const override
        {
            const double turn = std::numbers::pi * s, r = 1.0 / std::numbers::pi;
            return {{r * std::sin(turn), r * (1.0 - std::cos(turn)), 0.0},
                    {std::cos(turn), std::sin(turn), 0.0},
                    Vector3d::Zero()};
        }
        Motion carry(double s) const override
        {
            Motion motion;
            motion.R = rotation_about(Vector3d::UnitZ(), std::numbers::pi * s);
            motion.t = at(s).place - motion.R * Vector3d(s, 0, 0);
            return motion;
        }
        double length() const override { return 2.0; }
    };
    const double scale = 2.0 / (rod->end() - rod->begin());
    ASSERT_NEAR(scale, 1.0, 1e-12) << "the test's parameter is the length";
    const auto ring = std::make_shared<const Ring>();
    const std::shared_ptr<const SplineState> half =
        on_the_way(*rod, rod->rest(), ring, 0.5);
    for (const double s : {0.0, 0.3, 1.0, 1.7, 2.0})
        EXPECT_LT((half->carry(s).R -
                   rotation_about(Vector3d::UnitZ(), 0.5 * std::numbers::pi * s))
                      .norm(),
                  1e-9)
            << s;
    EXPECT_EQ(parts_between(*rod, *rod->rest(), *ring, 1e9), 8);
}

} // namespace cellwarp::core
