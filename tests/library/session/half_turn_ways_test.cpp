// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/half_turn_ways.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/base/number.h"
#include "octree/base/parallel.h"
#include "tests/support/bodies.h"
#include "tests/support/sessions.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::handles;
using support::largest_difference;
using support::long_bar;
using support::model;
using support::played;
using support::settings;

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

const std::string kEnds = "fixed foot box -9 -9 -9  9 9 0.25\n"
                          "handle head box -9 -9 3.75  9 9 9\n";

/// The head of the bar from 0 to 4 along z where an arc of \p degrees has it, which bends
/// about \p axis, across the bar; as a matrix with 12 digits.
std::string by_matrix(const Vector3d& axis, double degrees)
{
    const double angle = degrees * kPi / 180.0, radius = 3.5 / angle;
    const Matrix3d R = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    const Vector3d side = axis.cross(Vector3d::UnitZ());
    const Vector3d end =
        Vector3d(0, 0, 0.25) +
        radius * ((1.0 - std::cos(angle)) * side + std::sin(angle) * Vector3d::UnitZ());
    const Vector3d t = end - R * Vector3d(0, 0, 3.75);
    std::string text = "move head matrix";
    for (int row = 0; row < 3; ++row)
    {
        for (int column = 0; column < 3; ++column)
            text += " " + shortest(std::round(R(row, column) * 1e12) / 1e12 + 0.0);
        text += " " + shortest(t[row]);
    }
    return text + " 0 0 0 1\n";
}

/// How far samples are from the arc, at the most.
double off_arc(const Session& session, const Vector3d& axis, double degrees)
{
    const double angle = degrees * kPi / 180.0, radius = 3.5 / angle;
    const Vector3d side = axis.cross(Vector3d::UnitZ());
    double worst = 0.0;
    for (std::size_t i = 0; i < session.geometry().samples.size(); ++i)
    {
        const Vector3d x = session.geometry().samples[i] - Vector3d(0, 0, 0.25);
        const double turn = std::clamp(x.z() / 3.5, 0.0, 1.0) * angle,
                     rest = x.z() - std::clamp(x.z(), 0.0, 3.5);
        const Matrix3d R = Eigen::AngleAxisd(turn, axis).toRotationMatrix();
        const Vector3d place = Vector3d(0, 0, 0.25) +
                               radius * ((1.0 - std::cos(turn)) * side +
                                         std::sin(turn) * Vector3d::UnitZ()) +
                               R * Vector3d(x.x(), x.y(), rest);
        worst = std::max(worst, (session.deformed().samples[i] - place).norm());
    }
    return worst;
}

bool warns(const Session& session, const std::string& what)
{
    for (const std::string& warning : session.warnings())
        if (contains(warning, what))
            return true;
    return false;
}

} // namespace

// Half a turn is no exception: about any axis it ends between its neighbours.
TEST(HalfTurnWays, a_matrix_of_half_a_turn_bends_as_its_neighbours_do)
{
    const Shape bar = long_bar();
    for (const Vector3d& axis :
         {Vector3d(1, 0, 0), Vector3d(-1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, -1, 0)})
    {
        double before = 0.0;
        for (const double degrees : {179.0, 180.0})
        {
            const Session session =
                played(bar, kEnds + "frame 1\n" + by_matrix(axis, degrees), settings(8));
            const double off = off_arc(session, axis, degrees);
            if (degrees == 180.0)
            {
                EXPECT_LT(off, 1.1 * before) << axis.transpose();
            }
            EXPECT_EQ(
                warns(session, "frame 1: head turns by 180° with nothing that says"),
                degrees == 180.0);
            EXPECT_EQ(warns(session, "both ways were solved"), degrees == 180.0);
            before = off;
        }
    }
}

TEST(HalfTurnWays, a_told_axis_and_angle_keeps_its_sense_without_a_warning)
{
    const Shape bar = long_bar();
    for (const std::string sign : {"", "-"})
    {
        const std::string twist = "frame 1\nmove head rotate 0 0 1 " + sign;
        const Session half = played(bar, kEnds + twist + "180\n", settings(8));
        const Session nearly = played(bar, kEnds + twist + "179.99\n", settings(8));
        EXPECT_FALSE(warns(half, "180°"));
        EXPECT_LT(largest_difference(half.deformed().samples, nearly.deformed().samples),
                  1e-3);
    }
}

TEST(HalfTurnWays, ways_that_are_equal_go_one_way_whatever_the_rounding)
{
    const Shape bar = long_bar();
    const auto twisted = [&](const std::string& a, const std::string& b)
    {
        return played(bar,
                      kEnds + "frame 1\nmove head matrix -1 " + a + " 0 0  " + b +
                          " -1 0 0  0 0 1 0  0 0 0 1\n",
                      settings(8));
    };
    const Session plain = twisted("0", "0");
    EXPECT_TRUE(warns(plain, "both ways were solved"));
    for (const std::string size : {"1e-16", "1e-10", "1e-7"})
        for (const bool is_more : {false, true})
        {
            const Session session =
                is_more ? twisted(size, "-" + size) : twisted("-" + size, size);
            EXPECT_LT(
                largest_difference(session.deformed().samples, plain.deformed().samples),
                1e-5)
                << size;
        }
}

TEST(HalfTurnWays, handles_that_turn_alike_go_round_together)
{
    const std::string regions = "fixed foot box -9 -9 -9  9 9 0.25\n"
                                "handle left box -9 -9 3.75  -0.2 9 9\n"
                                "handle right box 0.2 -9 3.75  9 9 9\n";
    const auto move = [](const std::string& name, std::string text)
    { return text.replace(5, 4, name); };
    const Vector3d axis(0, -1, 0);
    const std::string matrix = by_matrix(axis, 180.0);
    const Session both = played(
        long_bar(), regions + "frame 1\n" + move("left", matrix) + move("right", matrix),
        settings(8));
    EXPECT_TRUE(warns(both, "left, right turns by 180°"));
    const Session one = played(long_bar(), kEnds + "frame 1\n" + matrix, settings(8));
    EXPECT_LT(largest_difference(both.deformed().samples, one.deformed().samples), 0.05);
}

TEST(HalfTurnWays, threads_and_replay_do_not_change_a_bit)
{
    const std::string text = kEnds + "frame 1\n" + by_matrix({1, 0, 0}, 180.0) +
                             "frame 2\n" + by_matrix({1, 0, 0}, 170.0);
    const Session many = played(long_bar(), text, settings(6, 2));
    const ThreadLimit one(1);
    const Session single = played(long_bar(), text, settings(6, 2));
    EXPECT_EQ(many.deformed().samples, single.deformed().samples);
}

} // namespace cellwarp::core
