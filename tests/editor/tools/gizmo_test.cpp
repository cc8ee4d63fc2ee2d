// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/gizmo.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

using Kind = GizmoPart::Kind;

Camera slanted_camera()
{
    Camera camera;
    camera.resize(800, 600);
    camera.look_from(Camera::View::Front);
    camera.orbit({-80, 60});
    return camera;
}

Eigen::Vector2d pixel_of(const Camera& camera, const Eigen::Vector3d& x)
{
    return camera.project(x)->head<2>();
}

std::string name_at(const std::vector<GizmoPart>& parts, const Camera& camera,
                    const Eigen::Vector2d& pixel)
{
    const auto hit = gizmo_part_at(parts, camera, pixel);
    if (!hit)
        return "none";
    static const char* const kinds[] = {"axis", "plane", "screen", "ring"};
    return kinds[static_cast<int>(parts[*hit].kind)] + std::string(" ") +
           std::to_string(parts[*hit].axis);
}

bool has(const std::vector<GizmoPart>& parts, Kind kind, int axis)
{
    return std::any_of(parts.begin(), parts.end(),
                       [&](const GizmoPart& part)
                       { return part.kind == kind && part.axis == axis; });
}

} // namespace

TEST(Gizmo, is_as_large_on_the_screen_from_any_distance)
{
    for (const double steps : {-8.0, 0.0, 8.0})
        for (const bool is_perspective : {true, false})
        {
            Camera camera = slanted_camera();
            camera.zoom(steps, {400, 300}, std::nullopt);
            if (!is_perspective)
                camera.toggle_perspective();
            const Eigen::Vector2d middle = pixel_of(camera, {0, 0, 0});
            for (const GizmoPart& part : turn_gizmo({0, 0, 0}, camera))
            {
                if (part.kind != Kind::Ring || part.axis != 3)
                    continue;
                for (const Eigen::Vector3d& x : part.line)
                    EXPECT_NEAR((pixel_of(camera, x) - middle).norm(), 95.0, 1e-6);
            }
        }
}

TEST(Gizmo, every_part_is_hit_where_it_is_seen)
{
    const Camera camera = slanted_camera();
    const Eigen::Vector3d centre(0.1, -0.05, 0.2);
    const double size = camera.pixel_size(centre);
    const auto move = move_gizmo(centre, camera);
    ASSERT_EQ(move.size(), 7u);
    EXPECT_EQ(name_at(move, camera, pixel_of(camera, centre)), "screen 0");
    for (int k = 0; k < 3; ++k)
    {
        const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k);
        const Eigen::Vector3d others = Eigen::Vector3d::Ones() - axis;
        EXPECT_EQ(name_at(move, camera, pixel_of(camera, centre + 80 * size * axis)),
                  "axis " + std::to_string(k));
        EXPECT_EQ(name_at(move, camera, pixel_of(camera, centre + 38 * size * others)),
                  "plane " + std::to_string(k));
    }
    EXPECT_EQ(name_at(move, camera, {5, 5}), "none");
    const auto turn = turn_gizmo(centre, camera);
    ASSERT_EQ(turn.size(), 5u);
    EXPECT_EQ(name_at(turn, camera, pixel_of(camera, centre)), "screen 0");
    EXPECT_EQ(
        name_at(turn, camera, pixel_of(camera, centre + 96 * size * camera.right())),
        "ring 3");
    for (int k = 0; k < 3; ++k)
    {
        // The nearest point of a ring is in front of the others.
        Eigen::Vector3d spoke = -camera.forward();
        spoke[k] = 0;
        EXPECT_EQ(name_at(turn, camera,
                          pixel_of(camera, centre + 80 * size * spoke.normalized())),
                  "ring " + std::to_string(k));
    }
}

TEST(Gizmo, of_two_rings_that_cross_on_the_screen_the_nearer_one_is_hit)
{
    Camera camera;
    camera.resize(800, 600);
    camera.toggle_perspective();
    camera.look_from(Camera::View::Front);
    camera.orbit({-100, 75});
    const auto turn = turn_gizmo({0, 0, 0}, camera);
    // Where the near half of one passes over the far half of another.
    int crossings = 0;
    for (const GizmoPart& front : turn)
        for (const GizmoPart& back : turn)
        {
            if (front.kind != Kind::Ring || back.kind != Kind::Ring || front.axis > 2 ||
                back.axis > 2 || front.axis == back.axis)
                continue;
            for (const Eigen::Vector3d& a : front.line)
                for (const Eigen::Vector3d& b : back.line)
                {
                    const double nearer = camera.forward().dot(b - a);
                    if (nearer < 100 * camera.pixel_size(a) ||
                        (pixel_of(camera, a) - pixel_of(camera, b)).norm() > 3)
                        continue;
                    ++crossings;
                    EXPECT_NE(name_at(turn, camera, pixel_of(camera, b)),
                              "ring " + std::to_string(back.axis));
                }
        }
    EXPECT_GT(crossings, 0);
}

TEST(Gizmo, leaves_out_what_is_seen_end_on_or_edge_on)
{
    Camera camera;
    camera.resize(800, 600);
    camera.look_from(Camera::View::Front); // along z, nearly
    camera.orbit({3, 4});
    const auto parts = move_gizmo({0, 0, 0}, camera);
    EXPECT_TRUE(has(parts, Kind::Axis, 0));
    EXPECT_TRUE(has(parts, Kind::Axis, 1));
    EXPECT_FALSE(has(parts, Kind::Axis, 2));
    EXPECT_FALSE(has(parts, Kind::Plane, 0));
    EXPECT_FALSE(has(parts, Kind::Plane, 1));
    EXPECT_TRUE(has(parts, Kind::Plane, 2));
}

TEST(Gizmo, where_an_arrow_passes_over_the_middle_the_middle_is_hit)
{
    Camera camera;
    camera.resize(800, 600);
    camera.look_from(Camera::View::Front);
    camera.orbit({25, 25});
    const auto parts = move_gizmo({0, 0, 0}, camera);
    const Eigen::Vector3d z = camera.pixel_size({0, 0, 0}) * Eigen::Vector3d::UnitZ();
    EXPECT_EQ(name_at(parts, camera, pixel_of(camera, 25 * z)), "screen 0");
    EXPECT_EQ(name_at(parts, camera, pixel_of(camera, 93 * z)), "axis 2");
}

TEST(Gizmo, is_not_there_behind_the_eye)
{
    const Camera camera = slanted_camera();
    const Eigen::Vector3d behind = camera.eye() - camera.forward();
    EXPECT_TRUE(move_gizmo(behind, camera).empty());
    EXPECT_TRUE(turn_gizmo(behind, camera).empty());
    EXPECT_EQ(name_at({}, camera, {400, 300}), "none");
}

TEST(Gizmo, a_view_of_no_size_does_no_harm)
{
    Camera camera;
    camera.resize(0, 0);
    const auto parts = move_gizmo({0, 0, 0}, camera);
    gizmo_part_at(parts, camera, {0, 0});
    gizmo_part_at(turn_gizmo({0, 0, 0}, camera), camera, {0, 0});
}

TEST(Gizmo, a_line_that_crosses_itself_leaves_out_what_it_goes_round_twice)
{
    // A square walked round twice, the second time smaller: a frame.
    const std::vector<Eigen::Vector2d> line = {{0, 0}, {10, 0}, {10, 10}, {0, 10},
                                               {0, 0}, {3, 3},  {7, 3},   {7, 7},
                                               {3, 7}, {3, 3}};
    EXPECT_TRUE(is_inside(line, {1, 5}));
    EXPECT_TRUE(is_inside(line, {8, 5}));
    EXPECT_FALSE(is_inside(line, {5, 5}));
    EXPECT_FALSE(is_inside(line, {12, 5}));
    EXPECT_FALSE(is_inside(line, {5, -1}));
    EXPECT_FALSE(is_inside({}, {0, 0}));
    // A corner at the pixel's own height counts once.
    const std::vector<Eigen::Vector2d> corner = {{5, 0}, {10, 5}, {5, 10}, {0, 5}};
    EXPECT_TRUE(is_inside(corner, {4, 5}));
    EXPECT_FALSE(is_inside(corner, {-1, 5}));
}

} // namespace cellwarp::core
