// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/gizmo_drag.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

using Kind = DragWay::Kind;
constexpr double kDegree = std::numbers::pi / 180.0;

Camera some_camera(std::mt19937& rng)
{
    Camera camera;
    camera.resize(800, 600);
    camera.look_from(Camera::View::Front);
    camera.orbit(
        {support::random_number(rng, -300, 300), support::random_number(rng, -60, 60)});
    if (rng() % 2)
        camera.toggle_perspective();
    return camera;
}

Eigen::Vector2d pixel_of(const Camera& camera, const Eigen::Vector3d& x)
{
    return camera.project(x)->head<2>();
}

Camera front()
{
    Camera camera;
    camera.resize(800, 600);
    camera.look_from(Camera::View::Front);
    return camera;
}

} // namespace

TEST(GizmoDrag, what_the_hand_took_hold_of_stays_under_the_pointer)
{
    std::mt19937 rng(12);
    for (int i = 0; i < 100; ++i)
    {
        SCOPED_TRACE(i);
        const Camera camera = some_camera(rng);
        const Eigen::Vector3d centre = support::random_vector(rng, 0.2);
        const Eigen::Vector3d shift = support::random_vector(rng, 0.3);
        for (int axis = 0; axis < 3; ++axis)
        {
            const Eigen::Vector3d along = shift[axis] * Eigen::Vector3d::Unit(axis);
            const double cosine = std::abs((centre - camera.eye()).normalized()[axis]);
            if (cosine < 0.9)
            {
                GizmoDrag drag(camera, centre, {Kind::MoveAxis, axis},
                               pixel_of(camera, centre));
                drag.move_to(pixel_of(camera, centre + along));
                EXPECT_LT((drag.amount().shift - along).norm(), 1e-9);
            }
            if (cosine > 0.4)
            {
                GizmoDrag drag(camera, centre, {Kind::MovePlane, axis},
                               pixel_of(camera, centre));
                drag.move_to(pixel_of(camera, centre + shift - along));
                EXPECT_LT((drag.amount().shift - (shift - along)).norm(), 1e-9);
            }
        }
        const Eigen::Vector3d flat =
            shift - shift.dot(camera.forward()) * camera.forward();
        GizmoDrag drag(camera, centre, {Kind::MoveScreen}, pixel_of(camera, centre));
        drag.move_to(pixel_of(camera, centre + flat));
        EXPECT_LT((drag.amount().shift - flat).norm(), 1e-9);
        EXPECT_EQ(drag.amount().degrees, 0.0);
    }
}

TEST(GizmoDrag, an_axis_that_points_at_the_viewer_goes_with_up_and_down)
{
    const Camera camera = front(); // along -z
    const double size = camera.pixel_size({0, 0, 0});
    GizmoDrag drag(camera, {0, 0, 0}, {Kind::MoveAxis, 2}, {400, 300});
    drag.move_to({400, 250}); // up: away from the viewer
    EXPECT_LT((drag.amount().shift - Eigen::Vector3d(0, 0, -50 * size)).norm(), 1e-12);
    drag.move_to({100, 300});
    EXPECT_LT(drag.amount().shift.norm(), 1e-12);
}

TEST(GizmoDrag, in_a_plane_seen_edge_on_goes_what_lies_in_it)
{
    const Camera camera = front();
    const double size = camera.pixel_size({0, 0, 0});
    GizmoDrag drag(camera, {0, 0, 0}, {Kind::MovePlane, 1}, {400, 300});
    drag.move_to({430, 200});
    EXPECT_LT((drag.amount().shift - Eigen::Vector3d(30 * size, 0, 0)).norm(), 1e-12);
}

TEST(GizmoDrag, beyond_the_horizon_the_last_place_holds)
{
    Camera camera = front();
    camera.orbit({0, 30}); // a little from above: the ground has a horizon
    GizmoDrag drag(camera, {0, 0, 0}, {Kind::MovePlane, 1}, {400, 300});
    drag.move_to({400, 290});
    const Eigen::Vector3d last = drag.amount().shift;
    EXPECT_GT(last.norm(), 0.0);
    drag.move_to({400, -5000});
    EXPECT_EQ(drag.amount().shift, last);
    drag.move_to({std::numeric_limits<double>::quiet_NaN(), 0});
    EXPECT_EQ(drag.amount().shift, last);
    // An axis that runs away from the viewer ends at its vanishing point.
    GizmoDrag axis(camera, {0, 0, 0}, {Kind::MoveAxis, 2}, {400, 300});
    for (double y = 300; y > -3000; y -= 10)
    {
        axis.move_to({400, y});
        EXPECT_LE(axis.amount().shift.z(), 1e-12);
        EXPECT_GT(axis.amount().shift.z(), -100.0);
    }
}

TEST(GizmoDrag, turns_by_the_angle_in_the_plane_of_the_ring)
{
    std::mt19937 rng(13);
    for (int i = 0; i < 60; ++i)
    {
        SCOPED_TRACE(i);
        const Camera camera = some_camera(rng);
        const Eigen::Vector3d centre = support::random_vector(rng, 0.2);
        for (int axis = 0; axis < 3; ++axis)
        {
            if (std::abs((centre - camera.eye()).normalized()[axis]) < 0.3)
                continue;
            const Eigen::Vector3d spoke = 0.2 * Eigen::Vector3d::Unit((axis + 1) % 3);
            GizmoDrag drag(camera, centre, {Kind::TurnAxis, axis},
                           pixel_of(camera, centre + spoke));
            for (int degrees = 0; degrees <= 400; degrees += 20)
                drag.move_to(pixel_of(
                    camera, centre + Eigen::AngleAxisd(degrees * kDegree,
                                                       Eigen::Vector3d::Unit(axis)) *
                                         spoke));
            EXPECT_NEAR(drag.amount().degrees, 400.0, 1e-6);
            EXPECT_EQ(drag.amount().axis, Eigen::Vector3d(Eigen::Vector3d::Unit(axis)));
        }
    }
}

TEST(GizmoDrag, turns_wind_either_way_about_the_line_of_sight)
{
    for (const double sign : {1.0, -1.0})
    {
        GizmoDrag drag(front(), {0, 0, 0}, {Kind::TurnView}, {500, 300});
        for (int degrees = 0; degrees <= 770; degrees += 10)
            drag.move_to({400 + 100 * std::cos(degrees * kDegree),
                          300 - sign * 100 * std::sin(degrees * kDegree)});
        EXPECT_NEAR(drag.amount().degrees, sign * 770, 1e-9);
        EXPECT_LT((drag.amount().axis - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
        drag.move_to({400, 300}); // on the centre there is no angle
        EXPECT_NEAR(drag.amount().degrees, sign * 770, 1e-9);
    }
}

TEST(GizmoDrag, a_ring_seen_edge_on_turns_like_the_rim_of_a_wheel)
{
    // About y, seen from the front: the near side goes to the right.
    GizmoDrag drag(front(), {0, 0, 0}, {Kind::TurnAxis, 1}, {400, 300});
    drag.move_to({480, 350});
    EXPECT_NEAR(drag.amount().degrees, 1.0 / kDegree, 1e-9);
    drag.move_to({400 - 80 * 8, 300}); // more than a turn
    EXPECT_NEAR(drag.amount().degrees, -8.0 / kDegree, 1e-9);
}

TEST(GizmoDrag, turned_freely_the_near_side_follows_the_pointer)
{
    std::mt19937 rng(14);
    for (int i = 0; i < 30; ++i)
    {
        const Camera camera = some_camera(rng);
        const Eigen::Vector2d way(support::random_number(rng, -20, 20),
                                  support::random_number(rng, -20, 20));
        GizmoDrag drag(camera, {0, 0, 0}, {Kind::TurnFree}, {300, 300});
        drag.move_to(Eigen::Vector2d(300, 300) + way);
        const DragAmount amount = drag.amount();
        EXPECT_NEAR(amount.degrees * kDegree, way.norm() / 80.0, 1e-12);
        const Eigen::Vector3d goes = amount.axis.cross(-camera.forward()) * way.norm();
        EXPECT_NEAR(goes.dot(camera.right()), way.x(), 1e-9);
        EXPECT_NEAR(goes.dot(camera.up()), -way.y(), 1e-9);
    }
}

TEST(GizmoDrag, snaps_to_steps_of_length_and_of_five_degrees)
{
    const Camera camera = front();
    const auto shift = [&](Kind kind, int axis, const Eigen::Vector3d& to)
    {
        GizmoDrag drag(camera, {0, 0, 0}, {kind, axis}, pixel_of(camera, {0, 0, 0}));
        drag.move_to(pixel_of(camera, to));
        return drag.amount({.snap = 0.05, .typed = {}}).shift;
    };
    EXPECT_LT(
        (shift(Kind::MoveAxis, 0, {0.12, 0, 0}) - Eigen::Vector3d(0.1, 0, 0)).norm(),
        1e-12);
    EXPECT_LT(
        (shift(Kind::MovePlane, 2, {0.13, -0.18, 0}) - Eigen::Vector3d(0.15, -0.2, 0))
            .norm(),
        1e-12);
    EXPECT_LT((shift(Kind::MoveScreen, 0, {0.02, 0.33, 0}) - Eigen::Vector3d(0, 0.35, 0))
                  .norm(),
              1e-12);
    GizmoDrag turn(camera, {0, 0, 0}, {Kind::TurnAxis, 2}, pixel_of(camera, {0.2, 0, 0}));
    turn.move_to(pixel_of(
        camera, {0.2 * std::cos(33 * kDegree), 0.2 * std::sin(33 * kDegree), 0}));
    EXPECT_NEAR(turn.amount().degrees, 33.0, 1e-9);
    EXPECT_NEAR(turn.amount({.snap = 0.05, .typed = {}}).degrees, 35.0, 1e-12);
}

TEST(GizmoDrag, a_typed_number_takes_the_place_of_the_pointers)
{
    const Camera camera = front();
    const auto typed = [&](const DragWay& way)
    {
        GizmoDrag drag(camera, {0, 0, 0}, way, {400, 300});
        drag.move_to({460, 380});
        return drag.amount({.snap = 0.05, .typed = -0.31});
    };
    EXPECT_EQ(typed({Kind::MoveAxis, 1}).shift, Eigen::Vector3d(0, -0.31, 0));
    EXPECT_EQ(typed({Kind::MovePlane, 0}).shift, Eigen::Vector3d(0, -0.31, 0));
    EXPECT_EQ(typed({Kind::MovePlane, 1}).shift, Eigen::Vector3d(-0.31, 0, 0));
    EXPECT_LT((typed({Kind::MoveScreen}).shift - Eigen::Vector3d(-0.31, 0, 0)).norm(),
              1e-12);
    EXPECT_EQ(typed({Kind::TurnAxis, 0}).degrees, -0.31);
}

TEST(GizmoDrag, turns_about_one_axis_add_up_and_about_others_become_one)
{
    RigidMove start;
    start.translation = {1, 2, 3};
    RigidMove turned = moved(start, {1, 0, 0}, {0, 0, 1}, 300);
    EXPECT_EQ(turned.translation, Eigen::Vector3d(2, 2, 3));
    EXPECT_EQ(turned.degrees, 300);
    turned = moved(turned, {0, 0, 0}, {0, 0, 1}, 250);
    EXPECT_EQ(turned.degrees, 550);
    turned = moved(turned, {0, 0, 0}, {0, 0, -1}, 100); // the same axis, the other way
    EXPECT_EQ(turned.degrees, 450);
    EXPECT_EQ(turned.axis, Eigen::Vector3d(0, 0, 1));
    const RigidMove both = moved(turned, {0, 0, 0}, {1, 0, 0}, 90);
    const Eigen::Matrix3d expected =
        (Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(450 * kDegree, Eigen::Vector3d::UnitZ()))
            .toRotationMatrix();
    const Eigen::Matrix3d is =
        Eigen::AngleAxisd(both.degrees * kDegree, both.axis).toRotationMatrix();
    EXPECT_LT((is - expected).norm(), 1e-12);
    EXPECT_NEAR(both.axis.norm(), 1.0, 1e-12);
    EXPECT_EQ(moved(turned, {0, 0, 0}, {1, 0, 0}, 0), turned);
}

} // namespace cellwarp::core
