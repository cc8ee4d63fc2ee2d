// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/body.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "octree/near_distances.h"
#include "tests/support/bodies.h"
#include "tests/support/pot.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/sanitized.h"
#include "tests/support/shapes.h"

#include <sys/resource.h>

namespace cellwarp::core
{

namespace
{

using support::random_number;
using support::random_vector;

/// Memory that the system has provided so far, whatever was given back [byte].
double provided_bytes()
{
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return 4096.0 * static_cast<double>(usage.ru_minflt);
}

/// Some closed boxes far apart, small ones and needles among them.
Shape boxes(std::mt19937& rng)
{
    Shape shape;
    for (int k = 0; k < 4; ++k)
    {
        const Eigen::Vector3d low = random_vector(rng, 0.5);
        const double size = std::pow(10.0, random_number(rng, -2.5, -0.7));
        Eigen::Vector3d extent(size, size, size);
        extent[k % 3] *= random_number(rng, 0.2, 5.0);
        shape = support::joined(shape, support::box_shape(low, low + extent, 2));
    }
    return support::turned(shape, support::random_rotation(rng));
}

/// Triangles anywhere.
Shape soup(std::mt19937& rng)
{
    Shape shape;
    for (std::uint32_t t = 0; t < 60; ++t)
    {
        const Eigen::Vector3d middle = random_vector(rng, 0.5);
        for (int k = 0; k < 3; ++k)
            shape.samples.push_back(middle + random_vector(rng, 0.05));
        shape.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    }
    return shape;
}

/// Points in a ball or on it.
Shape cloud(std::mt19937& rng)
{
    Shape shape;
    const bool is_hollow = random_number(rng, 0.0, 1.0) < 0.5;
    for (int i = 0; i < 300; ++i)
    {
        const Eigen::Vector3d x = random_vector(rng, 1.0);
        shape.samples.push_back(is_hollow ? Eigen::Vector3d(x.normalized()) : x);
    }
    return shape;
}

/// A few open sheets.
Shape sheets(std::mt19937& rng)
{
    Shape shape;
    for (int k = 0; k < 2; ++k)
    {
        Shape sheet =
            support::turned(support::sheet_shape(1.0, random_number(rng, 0.1, 0.8)),
                            support::random_rotation(rng));
        const Eigen::Vector3d step = random_vector(rng, 0.7);
        for (Eigen::Vector3d& x : sheet.samples)
            x += step;
        shape = support::joined(shape, sheet);
    }
    return shape;
}

/// Voxels that are no farther from the material [diagonal].
double num_within(const VoxelGrid& grid, double distance)
{
    const double reach = distance * grid.shape().size.norm() / grid.shape().voxel();
    const NearDistances near(grid.material(), grid.counts(), reach);
    double count = 0.0;
    for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
        count += !near.is_far(voxel);
    return count;
}

} // namespace

TEST(Body, of_a_pot_without_its_lid_is_solid_and_says_what_leaves_it_open)
{
    const Geometry pot =
        scan_geometry("pot.obj", support::obj_text(support::with_hole(
                                     support::pot(), {0.0, 0.8, 0.0}, 0.4)))
            .geometry;
    const auto has_warning = [&](const CellSettings& settings)
    {
        const auto rest = build_rest_shape(pot, pot.samples, settings);
        EXPECT_EQ(rest->sheets.patches.empty(), settings.fill == Fill::Solid);
        return std::any_of(
            rest->warnings.begin(), rest->warnings.end(),
            [](const std::string& warning)
            { return warning.find("--fill shell leaves it open") != std::string::npos; });
    };
    CellSettings settings;
    EXPECT_TRUE(has_warning(settings));
    settings.has_lids = true;
    EXPECT_FALSE(has_warning(settings));
    settings.has_lids = false;
    settings.fill = Fill::Shell;
    EXPECT_FALSE(has_warning(settings));
}

TEST(Body, of_small_shapes_takes_what_is_near_them_and_not_their_box)
{
    if (support::kIsSanitized)
        GTEST_SKIP() << "the sanitizer takes memory of its own";
    // The voxels of the box are looked at, in an array of bytes or two, again for the
    // parts that touch: that takes far less than a number for each. What encloses
    // an open shape is looked for only near it, with balls of up to 0.16 of the diagonal.
    constexpr double kMostNearVoxels = 4e7, kOfNearVoxel = 80.0; // [byte]
    constexpr double kOfVoxel = 8.0, kOfMaterial = 500.0, kOfItself = 1e7;
    for (unsigned seed = 0; seed < 100; ++seed)
    {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::mt19937 rng(seed);
        const bool is_closed = seed % 20 > 2;
        const Shape shape = is_closed        ? boxes(rng)
                            : seed % 20 == 0 ? soup(rng)
                            : seed % 20 == 1 ? cloud(rng)
                                             : sheets(rng);
        const Geometry geometry =
            scan_geometry("m.obj", support::obj_text(shape)).geometry;
        CellSettings settings;
        settings.max_depth = kUsualDepth;
        const double before = provided_bytes();
        const std::shared_ptr<const RestShape> rest =
            build_rest_shape(geometry, geometry.samples, settings);
        const double taken = provided_bytes() - before;
        const VoxelGrid& grid = rest->material.grid;
        const double voxels = num_voxels(grid.shape());
        double material = 0.0;
        for_each_set(grid.material(), [&](std::size_t) { ++material; });
        const double near = share_near(grid) * voxels;
        double allowed = kOfVoxel * voxels + kOfItself;
        if (is_closed)
            allowed += kOfMaterial * material;
        else
        {
            EXPECT_LE(near, kMostNearVoxels);
            allowed += kOfNearVoxel * num_within(grid, 0.16);
        }
        EXPECT_LE(taken, allowed);
    }
}

TEST(Body, of_clouds_has_no_finer_voxels_than_their_openings_need)
{
    const auto rest_of = [](const Shape& shape, int across, int max_depth)
    {
        CellSettings settings;
        settings.max_depth = max_depth;
        settings.across = across;
        const Geometry geometry =
            scan_geometry("m.obj", support::obj_text(shape)).geometry;
        return build_rest_shape(geometry, geometry.samples, settings);
    };
    const auto voxel_of = [](const RestShape& rest)
    { return rest.material.grid.shape().voxel() / rest.frame.diagonal(); };
    const double of_gap = CellSettings().gap / std::sqrt(6.0);
    std::mt19937 rng(5);
    const Shape open = cloud(rng);
    // Where cells are large enough not to need small voxels themselves.
    const auto rest = rest_of(open, 8, 0);
    EXPECT_GT(voxel_of(*rest), 1.1 * of_gap);
    EXPECT_LE(16.0 * voxel_of(*rest),
              2.5 * std::max(rest->material.seal_radius, rest->material.spacing) /
                  rest->frame.diagonal());
    EXPECT_FALSE(rest->warnings.empty());
    // Whoever chose the cells.
    const auto chosen = rest_of(open, 0, kUsualDepth);
    EXPECT_EQ(voxel_of(*rest_of(open, chosen->across, kUsualDepth)), voxel_of(*chosen));
    // A cube that lost two triangles is nearly closed: its openings tell nothing of the
    // rest.
    Shape cube = support::box_shape({0, 0, 0}, {1, 1, 1}, 8);
    cube.triangles.resize(cube.triangles.size() - 2);
    EXPECT_LE(voxel_of(*rest_of(cube, 8, 0)), of_gap * (1.0 + 1e-9));
}

TEST(Body, of_few_points_has_no_finer_cells_and_voxels_than_these_resolve)
{
    std::mt19937 rng(7);
    const auto points = [&](int count, const auto& place)
    {
        Geometry geometry;
        for (int i = 0; i < count; ++i)
            geometry.samples.push_back(place(i));
        return geometry;
    };
    const auto corner = [](int i) { return Eigen::Vector3d(i & 1, i >> 1 & 1, i >> 2); };
    const auto on_line = [](int i) { return Eigen::Vector3d(i, 2.0 * i, 0.5 * i); };
    const auto in_cube = [&](int) { return random_vector(rng, 1.0); };
    const auto on_sphere = [&](int) -> Eigen::Vector3d
    { return random_vector(rng, 1.0).normalized(); };
    const auto in_clusters = [&](int i) -> Eigen::Vector3d
    {
        return 0.02 * random_vector(rng, 1.0) +
               Eigen::Vector3d::Constant(i % 2 == 0 ? 0.0 : 1.0);
    };
    CellSettings settings;
    settings.max_depth = kUsualDepth;
    // The last two are dense where they are: their gap asks for more.
    for (const auto& [geometry, most] :
         {std::pair(points(8, corner), 1.25e6), std::pair(points(12, in_cube), 1.25e6),
          std::pair(points(300, in_cube), 1.25e6),
          std::pair(points(300, on_sphere), 1.25e6),
          std::pair(points(300, on_line), 4.2e6),
          std::pair(points(300, in_clusters), 7.2e6)})
    {
        const auto rest = build_rest_shape(geometry, geometry.samples, settings);
        EXPECT_LE(num_voxels(rest->material.grid.shape()), most);
        const Body body = build_body(rest, settings);
        EXPECT_LE(body.cells.size(), 3000u);
        for (const int cell : body.cell_of_sample)
            EXPECT_GE(cell, 0);
    }
    // A number of cells that is asked for is kept.
    settings.across = 40;
    const Geometry eight = points(8, corner);
    EXPECT_EQ(build_rest_shape(eight, eight.samples, settings)->across, 40);
}

} // namespace cellwarp::core
