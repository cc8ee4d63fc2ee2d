// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/contact/obstacle.h"

#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// The unit cube, each side of \p parts squared squares, two triangles each.
std::unique_ptr<Obstacle> cube(int parts)
{
    std::vector<Vector3d> vertices;
    std::vector<std::array<std::uint32_t, 3>> triangles;
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {0.0, 1.0})
        {
            const auto first = static_cast<std::uint32_t>(vertices.size());
            const auto row = static_cast<std::uint32_t>(parts + 1);
            for (int i = 0; i <= parts; ++i)
                for (int j = 0; j <= parts; ++j)
                {
                    Vector3d x;
                    x[axis] = side;
                    x[(axis + 1) % 3] = double(i) / parts;
                    x[(axis + 2) % 3] = double(j) / parts;
                    vertices.push_back(x);
                }
            for (std::uint32_t i = 0; i + 1 < row; ++i)
                for (std::uint32_t j = 0; j + 1 < row; ++j)
                {
                    const std::uint32_t a = first + i * row + j;
                    triangles.push_back({a, a + 1, a + row + 1});
                    triangles.push_back({a, a + row + 1, a + row});
                }
        }
    return mesh_obstacle(std::move(vertices), std::move(triangles));
}

std::vector<NearPlace> near(const Obstacle& obstacle, const Vector3d& x, double reach)
{
    std::vector<NearPlace> out;
    obstacle.near(x, reach, out);
    return out;
}

} // namespace

TEST(Obstacle, a_plane_and_a_sphere_are_near_on_one_side)
{
    const auto plane = plane_obstacle({0, 2, 0}, 4);
    EXPECT_TRUE(near(*plane, {1, 2.3, 1}, 0.2).empty());
    const auto on_plane = near(*plane, {1, 2.1, 3}, 0.2);
    ASSERT_EQ(on_plane.size(), 1u);
    EXPECT_LT((on_plane[0].place - Vector3d(1, 2, 3)).norm(), 1e-15);
    EXPECT_EQ(on_plane[0].normal, Vector3d::UnitY());
    // Behind it, it still pushes out.
    EXPECT_EQ(near(*plane, {1, 1, 3}, 0.2).at(0).normal, Vector3d::UnitY());
    const auto sphere = sphere_obstacle({1, 0, 0}, 0.5);
    EXPECT_TRUE(near(*sphere, {2, 0, 0}, 0.4).empty());
    const auto on_sphere = near(*sphere, {2, 0, 0}, 0.6);
    EXPECT_LT((on_sphere.at(0).place - Vector3d(1.5, 0, 0)).norm(), 1e-15);
    EXPECT_EQ(on_sphere[0].normal, Vector3d::UnitX());
    EXPECT_EQ(near(*sphere, {1, 0, 0}, 0.1).size(), 1u); // its very centre
    EXPECT_THROW(plane_obstacle({0, 0, 0}, 1), std::invalid_argument);
}

TEST(Obstacle, the_place_of_a_triangle_is_the_nearest_of_all)
{
    std::mt19937 rng(3);
    std::normal_distribution<double> normal;
    const auto random = [&] { return Vector3d(normal(rng), normal(rng), normal(rng)); };
    for (int k = 0; k < 300; ++k)
    {
        const Vector3d a = random(), b = random(), c = k % 10 == 0 ? a : random(),
                       x = 2.0 * random();
        const double away = (nearest_on_triangle(a, b, c, x) - x).norm();
        double least = 1e9;
        constexpr int kParts = 60;
        for (int i = 0; i <= kParts; ++i)
            for (int j = 0; i + j <= kParts; ++j)
                least = std::min(least, (a + double(i) / kParts * (b - a) +
                                         double(j) / kParts * (c - a) - x)
                                            .norm());
        EXPECT_LE(away, least + 1e-12);
        EXPECT_GE(away, least - 0.1);
    }
}

TEST(Obstacle, a_mesh_has_one_place_a_side_however_many_triangles_it_has)
{
    for (const int parts : {1, 2, 5, 10})
    {
        SCOPED_TRACE(parts);
        const auto box = cube(parts);
        // Both sides of a face, at an edge of triangles, and at a corner of them.
        for (const Vector3d& x : {Vector3d(0.37, 0.05, 0.61), Vector3d(0.37, -0.05, 0.61),
                                  Vector3d(0.5, 0.05, 0.5), Vector3d(0.4, 0.05, 0.4)})
        {
            const auto places = near(*box, x, 0.2);
            ASSERT_EQ(places.size(), 1u) << x.transpose();
            EXPECT_NEAR(places[0].normal.y(), x.y() > 0 ? 1.0 : -1.0, 1e-12);
            EXPECT_NEAR(places[0].place.y(), 0.0, 1e-15);
        }
        // Inside: two at an edge, three in a corner; outside one.
        EXPECT_EQ(near(*box, {0.5, 0.05, 0.06}, 0.2).size(), 2u);
        EXPECT_EQ(near(*box, {0.07, 0.05, 0.06}, 0.2).size(), 3u);
        const auto out = near(*box, {0.5, -0.05, -0.05}, 0.2);
        ASSERT_EQ(out.size(), 1u);
        EXPECT_LT((out[0].normal - Vector3d(0, -1, -1).normalized()).norm(), 1e-12);
        EXPECT_EQ(near(*box, {-0.05, -0.05, -0.05}, 0.2).size(), 1u);
        EXPECT_TRUE(near(*box, {0.5, 0.5, 0.5}, 0.2).empty());
        // On it.
        EXPECT_NEAR(std::abs(near(*box, {0.37, 0, 0.61}, 0.2).at(0).normal.y()), 1.0,
                    1e-12);
    }
}

} // namespace cellwarp::core
