// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/wrap/wrap.h"

#include <cfenv>
#include <numbers>
#include <thread>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/winding.h"
#include "tests/support/pot.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

double volume(const Shape& shape)
{
    double six = 0.0;
    for (const Triangle& t : shape.triangles)
        six += shape.samples[t[0]].dot(shape.samples[t[1]].cross(shape.samples[t[2]]));
    return six / 6.0;
}

} // namespace

TEST(AlphaWrap, is_closed_and_holds_all_points_at_its_offset)
{
    const Shape ball =
        support::level_set([](const Eigen::Vector3d& x) { return x.norm() - 1.0; },
                           {-1.2, -1.2, -1.2}, {1.2, 1.2, 1.2}, 0.1);
    const Shape wrap = alpha_wrap(ball.samples, 0.3, 0.05);
    EXPECT_EQ(bounding_surface(wrap).open_edges, 0.0);
    // Between the ball and the ball of its offset, but for the flat of its triangles.
    EXPECT_GT(volume(wrap), 0.97 * 4.0 / 3.0 * std::numbers::pi);
    EXPECT_LT(volume(wrap), 4.0 / 3.0 * std::numbers::pi * 1.05 * 1.05 * 1.05);
}

TEST(AlphaWrap, closes_what_a_ball_cannot_enter)
{
    const Shape pot = support::pot(0.08);
    const Shape open = support::with_hole(pot, {0, 0.8, 0}, 0.4);
    EXPECT_GT(volume(alpha_wrap(open.samples, 0.6, 0.03)), volume(pot));
    EXPECT_LT(volume(alpha_wrap(open.samples, 0.3, 0.03)), 0.5 * volume(pot));
}

TEST(AlphaWrap, around_triangles_does_not_enter_between_their_corners)
{
    const Shape box = support::box_shape({0, 0, 0}, {1, 1, 1}, 1);
    EXPECT_LT(volume(alpha_wrap(box.samples, 0.2, 0.02)), 0.5);
    EXPECT_NEAR(volume(alpha_wrap(box, 0.2, 0.02)), 1.0, 0.13);
    EXPECT_TRUE(alpha_wrap(Shape{box.samples, {}}, 0.2, 0.02).triangles.empty());
}

TEST(AlphaWrap, is_the_same_in_every_thread_and_leaves_the_rounding_alone)
{
    const Shape pot = support::pot(0.1);
    const Shape first = alpha_wrap(pot.samples, 0.2, 0.03);
    Shape second;
    std::thread([&] { second = alpha_wrap(pot.samples, 0.2, 0.03); }).join();
    EXPECT_EQ(first.samples, second.samples);
    EXPECT_EQ(first.triangles, second.triangles);
    EXPECT_EQ(std::fegetround(), FE_TONEAREST);
}

TEST(AlphaWrap, of_no_points_is_empty)
{
    EXPECT_TRUE(alpha_wrap(std::vector<Eigen::Vector3d>(), 0.2, 0.03).triangles.empty());
}

} // namespace cellwarp::core
