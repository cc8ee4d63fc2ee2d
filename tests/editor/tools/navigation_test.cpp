// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/navigation.h"

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

constexpr Modifiers kShift{.shift = true};
constexpr Modifiers kControl{.control = true};
constexpr Modifiers kAlt{.alt = true};
constexpr Modifiers kAltShift{.shift = true, .alt = true};
constexpr Modifiers kAltControl{.control = true, .alt = true};

} // namespace

TEST(Navigation, like_blender_the_middle_button_looks_around)
{
    const auto motion = [](Button button, const Modifiers& modifiers)
    { return camera_motion(Navigation::Blender, button, modifiers); };
    EXPECT_EQ(motion(Button::Middle, {}), CameraMotion::Orbit);
    EXPECT_EQ(motion(Button::Middle, kShift), CameraMotion::Pan);
    EXPECT_EQ(motion(Button::Middle, kControl), CameraMotion::Zoom);
    EXPECT_EQ(motion(Button::Right, {}), CameraMotion::Orbit);  // mice with two buttons
    EXPECT_EQ(motion(Button::Left, kAlt), CameraMotion::Orbit); // trackpads
    EXPECT_EQ(motion(Button::Left, kAltShift), CameraMotion::Pan);
    EXPECT_EQ(motion(Button::Left, kAltControl), CameraMotion::Zoom);
    EXPECT_FALSE(motion(Button::Left, {}));
    EXPECT_FALSE(motion(Button::Left, kShift));
}

TEST(Navigation, like_maya_alt_looks_around)
{
    const auto motion = [](Button button, const Modifiers& modifiers)
    { return camera_motion(Navigation::Maya, button, modifiers); };
    EXPECT_EQ(motion(Button::Left, kAlt), CameraMotion::Orbit);
    EXPECT_EQ(motion(Button::Middle, kAlt), CameraMotion::Pan);
    EXPECT_EQ(motion(Button::Right, kAlt), CameraMotion::Zoom);
    EXPECT_FALSE(motion(Button::Middle, {}));
    EXPECT_FALSE(motion(Button::Left, {}));
}

TEST(Navigation, a_drag_upwards_goes_nearer_to_where_it_began)
{
    Camera camera;
    camera.resize(800, 600);
    const double distance = (camera.eye() - camera.target()).norm();
    const Eigen::Vector3d point(0.1, 0.1, 0.1);
    const Eigen::Vector2d start = camera.project(point)->head<2>();
    move_camera(camera, CameraMotion::Zoom, start, start + Eigen::Vector2d(0, -50), start,
                point);
    EXPECT_LT((camera.eye() - camera.target()).norm(), distance);
    EXPECT_LT((camera.project(point)->head<2>() - start).norm(), 1e-6);
    const Eigen::Vector3d forward = camera.forward(), target = camera.target();
    move_camera(camera, CameraMotion::Pan, start, start + Eigen::Vector2d(9, 9), start,
                {});
    EXPECT_EQ(camera.forward(), forward);
    EXPECT_NE(camera.target(), target);
    move_camera(camera, CameraMotion::Orbit, start, start + Eigen::Vector2d(9, 9), start,
                {});
    EXPECT_NE(camera.forward(), forward);
}

} // namespace cellwarp::core
