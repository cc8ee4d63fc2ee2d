// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/hollows.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "octree/material.h"
#include "tests/support/files.h"
#include "tests/support/grids.h"
#include "tests/support/pot.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using Eigen::Vector3d;
using support::cloud_with_hole;
using support::pot;
using support::with_hole;

namespace
{

constexpr double kVoxel = 0.006; // [diagonal]

const Vector3d kTop(0, 0.8, 0); ///< where a pot has its lid

Material found(Shape shape, double voxel = kVoxel)
{
    const Vector3d size = support::to_origin({&shape});
    return find_material(shape, bounding_surface(shape),
                         grid_shape(size, 16, 0, voxel * size.norm()), Fill::Solid);
}

/// How many voxels more and fewer than the closed original an opened shape has [its
/// voxels].
struct Difference
{
    double more = 0.0, fewer = 0.0;
    InsideMethod method = InsideMethod::None;
};

Difference difference(Shape open, Shape closed)
{
    const Vector3d size = support::to_origin({&open, &closed});
    const GridShape shape = grid_shape(size, 16, 0, kVoxel * size.norm());
    const VoxelFlags truth =
        find_material(closed, bounding_surface(closed), shape, Fill::Solid)
            .grid.material();
    const Material material =
        find_material(open, bounding_surface(open), shape, Fill::Solid);
    Difference result;
    result.method = material.method;
    const double all = static_cast<double>(std::count(truth.begin(), truth.end(), 1));
    for (std::size_t i = 0; i < truth.size(); ++i)
    {
        const bool has = material.grid.material()[i];
        result.more += has && !truth[i] ? 1.0 / all : 0.0;
        result.fewer += truth[i] && !has ? 1.0 / all : 0.0;
    }
    return result;
}

Shape loose_triangles(const Shape& shape)
{
    Shape soup;
    for (std::size_t t = 0; t < shape.triangles.size(); ++t)
        if (t % 2 == 0)
        {
            for (const std::uint32_t k : shape.triangles[t])
                soup.samples.push_back(shape.samples[k]);
            const std::uint32_t end = static_cast<std::uint32_t>(soup.samples.size());
            soup.triangles.push_back({end - 3, end - 2, end - 1});
        }
    return soup;
}

/// A tube or bowl around the y axis: the part of a ball's surface between two heights.
Shape zone(double low, double high)
{
    Shape shape;
    constexpr std::uint32_t kRings = 40, kAround = 80;
    for (std::uint32_t i = 0; i <= kRings; ++i)
        for (std::uint32_t j = 0; j < kAround; ++j)
        {
            const double y = low + (high - low) * i / kRings;
            const double r = std::sqrt(std::max(0.0, 1.0 - y * y));
            const double angle = 2.0 * std::numbers::pi * j / kAround;
            shape.samples.emplace_back(r * std::cos(angle), y, r * std::sin(angle));
            const std::uint32_t next = (j + 1) % kAround;
            if (i == 0)
                continue;
            shape.triangles.push_back(
                {(i - 1) * kAround + j, i * kAround + j, i * kAround + next});
            shape.triangles.push_back(
                {(i - 1) * kAround + j, i * kAround + next, (i - 1) * kAround + next});
        }
    return shape;
}

} // namespace

TEST(Hollows, a_pot_without_its_lid_is_solid)
{
    // The lid is 0.13 and 0.2 of the diagonal wide; a flood closes 0.08.
    for (const double radius : {0.3, 0.45})
    {
        SCOPED_TRACE(radius);
        const Shape closed = pot(), open = with_hole(closed, kTop, radius);
        const Shape cloud =
            cloud_with_hole(support::random_points(closed, 30000, 4), kTop, radius);
        const Difference mesh = difference(open, closed);
        EXPECT_EQ(mesh.method, InsideMethod::Hollows);
        EXPECT_LT(mesh.more, 1e-9);
        EXPECT_LT(mesh.fewer, 0.02);
        const Difference soup = difference(loose_triangles(open), closed);
        EXPECT_EQ(soup.method, InsideMethod::Hollows);
        EXPECT_LT(soup.more, 0.005);
        EXPECT_LT(soup.fewer, 0.04);
        const Difference points = difference(cloud, closed);
        EXPECT_EQ(points.method, InsideMethod::Hollows);
        EXPECT_LT(points.more, 0.005);
        EXPECT_LT(points.fewer, 0.06); // the marks of faces are thicker
    }
}

TEST(Hollows, nothing_grows_out_of_the_surface_whatever_the_opening)
{
    // A ball of radius 15 with a hole of 4, far from the border of the grid.
    const VoxelGrid grid = support::grid_of(Eigen::Vector3i::Constant(60));
    const auto away = [&](std::size_t i)
    { return (grid.coordinates(i).cast<double>() - Vector3d::Constant(29.5)).norm(); };
    VoxelFlags marks(grid.size());
    for (std::size_t i = 0; i < grid.size(); ++i)
    {
        const Eigen::Vector3i v = grid.coordinates(i);
        const bool is_hole = v.z() > 30 && std::hypot(v.x() - 29.5, v.y() - 29.5) < 4.0;
        marks[i] = std::abs(away(i) - 15.0) < 1.0 && !is_hole;
    }
    for (const double narrowest : {2.0, 2.5, 3.0, 3.125, 4.0, 4.9})
    {
        const Hollows hollows = hollow_voxels(grid, marks, {narrowest, 9.0},
                                              [](std::size_t) { return true; });
        EXPECT_NEAR(hollows.radius, 4.0, 1.5) << narrowest;
        std::size_t inside = 0;
        for (std::size_t i = 0; i < grid.size(); ++i)
        {
            inside += hollows.is_inside[i];
            ASSERT_TRUE(!hollows.is_inside[i] || away(i) < 16.0)
                << narrowest << ": " << grid.coordinates(i).transpose();
        }
        EXPECT_GT(inside, 10000u) << narrowest; // of 11,500
    }
}

TEST(Hollows, what_is_as_wide_as_its_opening_is_a_shell)
{
    EXPECT_EQ(found(zone(-1.0, 0.0)).method, InsideMethod::None);  // a bowl
    EXPECT_EQ(found(zone(-0.3, 0.3)).method, InsideMethod::None);  // a ring
    EXPECT_EQ(found(zone(-1.0, 0.65)).method, InsideMethod::None); // a deep bowl
    EXPECT_EQ(found(with_hole(pot(), kTop, 0.75)).method, InsideMethod::None);
}

TEST(Hollows, an_opening_may_be_two_thirds_as_wide_as_the_ball_behind_it)
{
    // Radius 0.44 of 1, the diagonal is 3.4.
    const Material ball = found(zone(-1.0, 0.9));
    EXPECT_EQ(ball.method, InsideMethod::Hollows);
    EXPECT_NEAR(ball.seal_radius, 0.44, 0.15);
}

TEST(Hollows, two_bodies_each_get_their_own)
{
    // Side by side: a ball with a hole of 0.44 and one of half its size.
    Shape small = zone(-1.0, 0.9);
    for (Vector3d& x : small.samples)
        x = 0.5 * x + Vector3d(1.7, 0.0, 0.0);
    Shape both = support::joined(zone(-1.0, 0.9), small);
    const Material material = found(both, 0.004);
    EXPECT_EQ(material.method, InsideMethod::Hollows);
    const auto holds = [&](const Vector3d& x)
    {
        const VoxelGrid& grid = material.grid;
        return grid.material()[grid.index(grid.locate(x + Vector3d(1.0, 1.0, 1.0)))] != 0;
    };
    EXPECT_TRUE(holds({0, 0, 0}));
    EXPECT_TRUE(holds({1.7, 0, 0}));
    EXPECT_FALSE(holds({1.1, 0.3, 0})); // the groove between them
}

TEST(Hollows, a_groove_is_outside_though_gaps_lead_to_it)
{
    // Every second triangle is missing; a ball that the lid's opening keeps out does not
    // come into the handle's ring either.
    const Shape closed = pot();
    const Shape open = loose_triangles(with_hole(closed, kTop, 0.45));
    Shape moved = open;
    const Vector3d size = support::to_origin({&moved});
    const Vector3d shift = moved.samples[0] - open.samples[0];
    const Material material =
        find_material(moved, bounding_surface(moved),
                      grid_shape(size, 16, 0, kVoxel * size.norm()), Fill::Solid);
    const VoxelGrid& grid = material.grid;
    // Within the handle's ring.
    EXPECT_FALSE(
        grid.material()[grid.index(grid.locate(Vector3d(-1.2, 0.05, 0) + shift))]);
    EXPECT_TRUE(grid.material()[grid.index(grid.locate(shift))]);
}

TEST(Hollows, the_sample_vase_stays_a_shell)
{
    const Geometry vase = read_geometry(support::samples_folder() + "/vase.obj").geometry;
    Shape shape{vase.samples, {}};
    for (std::size_t f = 0; f < vase.num_faces(); ++f)
        for (std::size_t k = 2; k < vase.face(f).size(); ++k)
            shape.triangles.push_back(
                {vase.face(f)[0], vase.face(f)[k - 1], vase.face(f)[k]});
    EXPECT_EQ(found(shape).method, InsideMethod::None);
    EXPECT_EQ(found(Shape{shape.samples, {}}).method, InsideMethod::None);
}

} // namespace cellwarp::core
