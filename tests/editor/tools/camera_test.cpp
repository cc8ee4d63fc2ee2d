// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/camera.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <sstream>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Eigen::Vector2d random_pixels(std::mt19937& rng, double size)
{
    return {support::random_number(rng, -size, size),
            support::random_number(rng, -size, size)};
}

/// Anything that a user may have arrived at.
Camera random_camera(std::mt19937& rng, int up = 1)
{
    Camera camera(up);
    camera.resize(support::random_number(rng, 50, 2000),
                  support::random_number(rng, 50, 2000));
    camera.orbit(random_pixels(rng, 500));
    camera.pan(random_pixels(rng, 100));
    camera.zoom(support::random_number(rng, -5, 5), {100, 100}, std::nullopt);
    if (rng() % 2)
        camera.toggle_perspective();
    return camera;
}

void expect_right_handed(const Camera& camera, const std::string& what)
{
    SCOPED_TRACE(what);
    Eigen::Matrix3d axes;
    axes << camera.right(), camera.up(), -camera.forward();
    EXPECT_LT((axes.transpose() * axes - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_GT(axes.determinant(), 0);
}

} // namespace

TEST(Camera, project_and_ray_are_inverse)
{
    std::mt19937 rng(3);
    for (int i = 0; i < 200; ++i)
    {
        SCOPED_TRACE(i);
        const Camera camera = random_camera(rng, i % 3);
        const Eigen::Vector2d pixel = random_pixels(rng, 1500);
        const Ray ray = camera.ray(pixel);
        EXPECT_NEAR(ray.direction.norm(), 1.0, 1e-12);
        const auto seen = camera.project(ray.origin + 3.7 * ray.direction);
        ASSERT_TRUE(seen);
        EXPECT_LT((seen->head<2>() - pixel).norm(), 1e-7);
    }
}

TEST(Camera, project_agrees_with_the_matrices)
{
    std::mt19937 rng(4);
    for (int i = 0; i < 200; ++i)
    {
        SCOPED_TRACE(i);
        const Camera camera = random_camera(rng, i % 3);
        const Eigen::Vector3d point = support::random_vector(rng, 0.5);
        const auto seen = camera.project(point);
        const Eigen::Vector4d clip =
            camera.projection_matrix() * camera.view_matrix() * point.homogeneous();
        if (!seen)
        {
            EXPECT_LT(clip.w(), 1e-9);
            continue;
        }
        const Eigen::Vector3d at = clip.hnormalized();
        EXPECT_NEAR(seen->x(), 0.5 * camera.width() * (1 + at.x()), 1e-6);
        EXPECT_NEAR(seen->y(), 0.5 * camera.height() * (1 - at.y()), 1e-6);
        if (seen->z() > 0.1 * (camera.eye() - camera.target()).norm())
        {
            EXPECT_LT(std::abs(at.z()), 1.0);
        }
    }
}

TEST(Camera, what_lies_behind_the_eye_is_not_seen)
{
    Camera camera;
    EXPECT_FALSE(camera.project(camera.eye() - camera.forward()));
    EXPECT_FALSE(camera.project(camera.eye()));
    EXPECT_TRUE(camera.project(camera.eye() + camera.forward()));
    camera.toggle_perspective();
    EXPECT_TRUE(camera.project(camera.eye() - camera.forward()));
    EXPECT_FALSE(camera.project({kNan, 0, 0}));
}

TEST(Camera, zooming_keeps_what_is_under_the_pointer)
{
    std::mt19937 rng(5);
    for (int i = 0; i < 100; ++i)
    {
        SCOPED_TRACE(i);
        Camera camera = random_camera(rng);
        const Eigen::Vector2d pixel = random_pixels(rng, 800);
        const Ray ray = camera.ray(pixel);
        const double distance = (camera.eye() - camera.target()).norm();
        Eigen::Vector3d point = ray.origin + 2.0 * ray.direction;
        const bool is_given = i % 2;
        if (!is_given) // at the depth of the target
            point = ray.origin + ray.direction *
                                     camera.forward().dot(camera.target() - ray.origin) /
                                     camera.forward().dot(ray.direction);
        camera.zoom(2.5, pixel, is_given ? std::optional(point) : std::nullopt);
        EXPECT_NEAR((camera.eye() - camera.target()).norm(),
                    distance * std::pow(1.15, -2.5), 1e-9);
        const auto seen = camera.project(point);
        ASSERT_TRUE(seen);
        EXPECT_LT((seen->head<2>() - pixel).norm(), 1e-6);
    }
}

TEST(Camera, zooming_ends_somewhere)
{
    Camera camera;
    camera.resize(800, 600);
    for (int i = 0; i < 1000; ++i)
        camera.zoom(10, {10, 20}, Eigen::Vector3d(0.1, 0.2, 0.3));
    EXPECT_GT((camera.eye() - camera.target()).norm(), 1e-6);
    for (int i = 0; i < 1000; ++i)
        camera.zoom(-10, {10, 20}, std::nullopt);
    EXPECT_LT((camera.eye() - camera.target()).norm(), 1e3);
    EXPECT_LT(camera.target().norm(), 1e3);
    camera.zoom(-1e300, {10, 20}, std::nullopt);
    camera.zoom(1e300, {10, 20}, std::nullopt);
    EXPECT_TRUE(camera.view_matrix().allFinite());
    EXPECT_TRUE(camera.projection_matrix().allFinite());
}

TEST(Camera, panning_moves_the_target_with_the_pointer)
{
    std::mt19937 rng(6);
    for (int i = 0; i < 20; ++i)
    {
        Camera camera = random_camera(rng);
        const Eigen::Vector3d target = camera.target();
        camera.pan({30, -20});
        const auto seen = camera.project(target);
        ASSERT_TRUE(seen);
        EXPECT_NEAR(seen->x(), 0.5 * camera.width() + 30, 1e-8);
        EXPECT_NEAR(seen->y(), 0.5 * camera.height() - 20, 1e-8);
    }
}

TEST(Camera, framing_shows_the_whole_box_at_any_aspect_ratio)
{
    std::mt19937 rng(8);
    for (const double width : {1.0, 40.0, 300.0, 3000.0})
        for (const double height : {1.0, 40.0, 300.0, 3000.0})
            for (int i = 0; i < 20; ++i)
            {
                SCOPED_TRACE(testing::Message() << width << " x " << height);
                Camera camera = random_camera(rng);
                camera.resize(width, height);
                const Eigen::Vector3d a = support::random_vector(rng, 0.5);
                const Eigen::Vector3d b = support::random_vector(rng, 0.5);
                const Eigen::Vector3d low = a.cwiseMin(b), high = a.cwiseMax(b);
                camera.frame(low, high);
                double fill = 0.0;
                for (int corner = 0; corner < 8; ++corner)
                {
                    const auto seen = camera.project({corner & 1 ? high.x() : low.x(),
                                                      corner & 2 ? high.y() : low.y(),
                                                      corner & 4 ? high.z() : low.z()});
                    ASSERT_TRUE(seen);
                    fill = std::max({fill, std::abs(2 * seen->x() / width - 1),
                                     std::abs(2 * seen->y() / height - 1)});
                }
                EXPECT_LE(fill, 0.9);
                if ((high - low).minCoeff() > 0.2)
                {
                    EXPECT_GT(fill, 0.8); // and not smaller than need be
                }
            }
}

TEST(Camera, orbiting_never_flips)
{
    for (const int up : {0, 1, 2})
    {
        Camera camera(up);
        camera.resize(800, 600);
        Eigen::Vector3d last = camera.up();
        for (int i = 0; i < 2000; ++i)
        {
            camera.orbit({1.0, i < 1000 ? 1.0 : -1.0});
            expect_right_handed(camera, "orbit");
            // Upright, and never far from where it was.
            EXPECT_GE(camera.up()[up], -1e-12);
            EXPECT_GT(camera.up().dot(last), 0.99);
            last = camera.up();
        }
    }
}

TEST(Camera, a_trackball_turns_about_the_axes_of_the_screen_beyond_the_poles)
{
    std::mt19937 rng(7);
    for (int i = 0; i < 50; ++i)
    {
        SCOPED_TRACE(i);
        Camera camera = random_camera(rng, i % 3);
        const Eigen::Vector3d eye = camera.eye(), target = camera.target();
        camera.set_turning(Camera::Turning::Trackball);
        EXPECT_LT((camera.eye() - eye).norm(), 1e-12);
        camera.orbit(random_pixels(rng, 2000));
        expect_right_handed(camera, "turned");
        EXPECT_EQ(camera.target(), target);
        // Downwards about the screen's own horizontal axis: half a turn is upside down.
        const Eigen::Vector3d right = camera.right(), up = camera.up();
        const double half = std::numbers::pi / 0.007; // [pixel]
        camera.orbit({0, half});
        EXPECT_LT((camera.right() - right).norm(), 1e-9);
        EXPECT_LT((camera.up() + up).norm(), 1e-9);
        camera.orbit({half, 0});
        EXPECT_LT((camera.right() + right).norm(), 1e-9);
        // A turntable again: it looks along the same line, upright.
        const Eigen::Vector3d forward = camera.forward();
        camera.set_turning(Camera::Turning::Turntable);
        EXPECT_LT((camera.forward() - forward).norm(), 1e-7);
        EXPECT_GE(camera.up()[i % 3], -1e-12);
        expect_right_handed(camera, "turntable");
    }
}

TEST(Camera, seen_along_the_up_axis_a_turntable_keeps_what_is_to_the_right)
{
    Camera camera(2);
    camera.look_from(Camera::View::Top);
    camera.orbit({123, 0});
    const Eigen::Vector3d right = camera.right();
    camera.set_turning(Camera::Turning::Trackball);
    camera.set_turning(Camera::Turning::Turntable);
    EXPECT_LT((camera.right() - right).norm(), 1e-6);
}

TEST(Camera, another_up_axis_is_upright_at_once_on_a_turntable)
{
    Camera camera;
    camera.orbit({40, -30});
    for (const int up : {0, 2, 1})
    {
        camera.set_up_axis(up);
        EXPECT_EQ(camera.up_axis(), up);
        EXPECT_NEAR(camera.right()[up], 0.0, 1e-12);
        EXPECT_GT(camera.up()[up], 0.5);
        expect_right_handed(camera, "up");
    }
    camera.set_turning(Camera::Turning::Trackball);
    const Eigen::Vector3d forward = camera.forward();
    camera.set_up_axis(0);
    EXPECT_EQ(camera.forward(), forward);
    camera.look_from(Camera::View::Front);
    EXPECT_NEAR(camera.up()[0], 1.0, 1e-12);
}

TEST(Camera, the_numbered_views_look_along_the_axes)
{
    const Eigen::Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
    Camera camera(1);
    const auto expect =
        [&](Camera::View view, const Eigen::Vector3d& forward, const Eigen::Vector3d& up)
    {
        camera.look_from(view);
        EXPECT_LT((camera.forward() - forward).norm(), 1e-12);
        EXPECT_LT((camera.up() - up).norm(), 1e-12);
        expect_right_handed(camera, "view");
    };
    expect(Camera::View::Front, -z, y);
    expect(Camera::View::Back, z, y);
    expect(Camera::View::Right, -x, y);
    expect(Camera::View::Left, x, y);
    expect(Camera::View::Top, -y, -z);
    expect(Camera::View::Bottom, y, z);
    camera = Camera(2);
    expect(Camera::View::Front, y, z);
    expect(Camera::View::Right, -x, z);
    expect(Camera::View::Top, -z, y);
}

TEST(Camera, parallel_projection_shows_the_target_as_large_as_perspective)
{
    Camera camera;
    camera.resize(700, 500);
    const double size = camera.pixel_size(camera.target());
    const Eigen::Vector3d beside = camera.target() + size * camera.right();
    EXPECT_NEAR((*camera.project(beside)).x(), 351.0, 1e-9);
    camera.toggle_perspective();
    EXPECT_NEAR(camera.pixel_size(camera.target()), size, 1e-12);
    EXPECT_NEAR((*camera.project(beside)).x(), 351.0, 1e-9);
}

TEST(Camera, looks_again_as_its_text_says)
{
    std::mt19937 rng(12);
    for (int i = 0; i < 60; ++i)
    {
        SCOPED_TRACE(i);
        Camera camera = random_camera(rng, i % 3);
        if (i % 2)
        {
            camera.set_turning(Camera::Turning::Trackball);
            camera.orbit(random_pixels(rng, 500));
        }
        const std::string text = camera.text();
        Camera other;
        other.resize(camera.width(), camera.height());
        ASSERT_TRUE(other.look_as(text));
        EXPECT_EQ(other.text(), text);
        EXPECT_EQ(other.view_matrix(), camera.view_matrix());
        EXPECT_EQ(other.projection_matrix(), camera.projection_matrix());
        EXPECT_EQ(other.turning(), camera.turning());
        camera.orbit({30, 20});
        other.orbit({30, 20});
        EXPECT_EQ(other.view_matrix(), camera.view_matrix());
    }
}

TEST(Camera, a_text_of_no_camera_changes_nothing)
{
    const std::string good = Camera().text();
    const auto with = [&](std::size_t k, const std::string& number)
    {
        std::istringstream words(good);
        std::string text, word;
        for (std::size_t i = 0; words >> word; ++i)
            text += (i ? " " : "") + (i == k ? number : word);
        return text;
    };
    EXPECT_EQ(with(99, ""), good);
    Camera camera;
    camera.orbit({100, 0});
    const std::string before = camera.text();
    for (const std::string& text :
         {std::string(), std::string("from the left"), good + " 1", good + "x",
          good.substr(0, good.rfind(' ')), with(0, "3"), with(0, "0.5"), with(1, "2"),
          with(3, "nan"), with(4, "7"), with(5, "0"), with(5, "1e300"), with(6, "inf"),
          with(9, "2"), with(17, "-1")})
    {
        EXPECT_FALSE(camera.look_as(text)) << text;
        EXPECT_EQ(camera.text(), before);
    }
    EXPECT_TRUE(camera.look_as(good));
}

TEST(Camera, a_view_of_no_size_and_numbers_that_are_none_do_no_harm)
{
    for (const double size : {0.0, 1.0})
    {
        Camera camera;
        camera.resize(size, size);
        camera.resize(kNan, 5);
        camera.resize(-1, 5);
        EXPECT_EQ(camera.width(), size);
        camera.orbit({kNan, 1});
        camera.pan({1, kNan});
        camera.zoom(kNan, {0, 0}, std::nullopt);
        camera.zoom(1, {kNan, 0}, std::nullopt);
        camera.zoom(1, {0, 0}, Eigen::Vector3d(kNan, 0, 0));
        camera.frame({kNan, 0, 0}, {1, 1, 1});
        camera.frame({0, 0, 0}, {0, 0, 0});
        camera.frame({-1, -1, -1}, {1, 1, 1});
        EXPECT_TRUE(camera.view_matrix().allFinite());
        EXPECT_TRUE(camera.projection_matrix().allFinite());
        EXPECT_TRUE(camera.ray({0, 0}).direction.allFinite());
        EXPECT_TRUE(camera.project({0.1, 0.1, 0.1}));
        EXPECT_TRUE(std::isfinite(camera.pixel_size({0, 0, 0})));
    }
}

} // namespace cellwarp::core
