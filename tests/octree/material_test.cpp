// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/material.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "octree/distance_transform.h"
#include "octree/pieces.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::box_shape;
using support::joined;

namespace
{

double volume(const VoxelGrid& grid)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < grid.size(); ++i)
        if (grid.material()[i])
        {
            const Eigen::Vector3i v = grid.coordinates(i);
            double product = 1.0;
            for (int k = 0; k < 3; ++k)
                product *= grid.lines(k)[idx(v[k]) + 1] - grid.lines(k)[idx(v[k])];
            sum += product;
        }
    return sum;
}

Material found(const Shape& shape, Fill fill = Fill::Solid, double voxel = 0.02)
{
    Eigen::Vector3d high = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& x : shape.samples)
        high = high.cwiseMax(x);
    return find_material(shape, bounding_surface(shape), grid_shape(high, 8, 0, voxel),
                         fill);
}

bool holds(const Material& material, const Eigen::Vector3d& x)
{
    return material.grid.material()[material.grid.index(material.grid.locate(x))] != 0;
}

} // namespace

TEST(Material, a_closed_box_is_filled_to_its_volume)
{
    const Material material = found(box_shape({0, 0, 0}, {2, 1, 0.5}));
    EXPECT_EQ(material.method, InsideMethod::Winding);
    EXPECT_NEAR(volume(material.grid), 1.0, 1e-9);
}

TEST(Material, orientation_does_not_matter_for_the_inside)
{
    Shape shape = box_shape({0, 0, 0}, {1, 1, 1});
    for (Triangle& t : shape.triangles)
        std::swap(t[1], t[2]);
    EXPECT_NEAR(volume(found(shape).grid), 1.0, 1e-9);
    // Mixed: no winding number, but what a flood does not reach is inside.
    std::swap(shape.triangles[5][0], shape.triangles[5][1]);
    EXPECT_NEAR(volume(found(shape).grid), 1.0, 1e-9);
}

TEST(Material, overlapping_parts_are_inside_and_a_void_is_not)
{
    const Shape outer = box_shape({0, 0, 0}, {1, 1, 1});
    const Shape overlapping =
        joined(outer, box_shape({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75}));
    EXPECT_TRUE(holds(found(overlapping), {0.5, 0.5, 0.5}));
    Shape inner = box_shape({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75});
    for (Triangle& t : inner.triangles)
        std::swap(t[1], t[2]);
    EXPECT_FALSE(holds(found(joined(outer, inner)), {0.5, 0.5, 0.5}));
}

TEST(Material, flaws_of_a_mesh_do_not_change_it)
{
    const Shape clean = box_shape({0, 0, 0}, {1, 1, 1});
    const VoxelFlags wanted = found(clean).grid.material();
    Shape soup; // unshared corners, shuffled
    for (const Triangle& t : clean.triangles)
        for (const std::uint32_t i : t)
            soup.samples.push_back(clean.samples[i]);
    for (std::uint32_t i = 0; i + 2 < soup.samples.size(); i += 3)
        soup.triangles.push_back({i, i + 1, i + 2});
    std::shuffle(soup.triangles.begin(), soup.triangles.end(), std::mt19937(1));
    EXPECT_EQ(found(soup).grid.material(), wanted);
    Shape flawed = clean;
    flawed.triangles.push_back(clean.triangles[3]); // twice
    flawed.triangles.push_back({clean.triangles[4][0], clean.triangles[4][2],
                                clean.triangles[4][1]}); // and reversed
    flawed.triangles.push_back({0, 0, 1});               // degenerate
    EXPECT_EQ(found(flawed).grid.material(), wanted);
}

TEST(Material, faces_of_both_directions_are_a_flaw_or_a_wall)
{
    const Shape clean = box_shape({0, 0, 0}, {1, 1, 1});
    const VoxelFlags wanted = found(clean).grid.material();
    for (const std::size_t count : {clean.triangles.size(), clean.triangles.size() / 3})
    {
        Shape two_sided = clean;
        for (std::size_t t = 0; t < count; ++t)
            two_sided.triangles.push_back(
                {clean.triangles[t][0], clean.triangles[t][2], clean.triangles[t][1]});
        EXPECT_EQ(found(two_sided).grid.material(), wanted);
        EXPECT_EQ(found(two_sided).method, InsideMethod::Winding);
    }
    // Two boxes that touch: their common wall is there twice.
    const Material touching = found(
        joined(box_shape({0, 0, 0}, {0.5, 1, 1}), box_shape({0.5, 0, 0}, {1, 1, 1})));
    EXPECT_EQ(touching.method, InsideMethod::Winding);
    EXPECT_EQ(touching.grid.material(), wanted);
}

TEST(Material, a_few_holes_do_not_let_the_outside_in)
{
    Shape shape = box_shape({0, 0, 0}, {1, 1, 1}, 40);
    shape.triangles.erase(shape.triangles.begin() + 1500, shape.triangles.begin() + 1504);
    const Material material = found(shape);
    EXPECT_EQ(material.method, InsideMethod::Votes);
    EXPECT_NEAR(volume(material.grid), 1.0, 0.01);
}

TEST(Material, a_soup_that_lost_two_of_three_triangles_is_filled)
{
    Shape shape = box_shape({0, 0, 0}, {1, 1, 1}, 40);
    std::shuffle(shape.triangles.begin(), shape.triangles.end(), std::mt19937(2));
    shape.triangles.resize(shape.triangles.size() / 3);
    const Material material = found(shape);
    EXPECT_EQ(material.method, InsideMethod::Hollows);
    EXPECT_NEAR(volume(material.grid), 1.0, 0.03); // a fifth of a voxel all around
}

TEST(Material, a_cloud_is_filled_like_the_mesh_that_it_samples)
{
    const Shape mesh = box_shape({0, 0, 0}, {1, 1, 1});
    Shape cloud{support::random_points(mesh, 20000, 3), {}};
    cloud.samples.push_back({0, 0, 0});
    cloud.samples.push_back({1, 1, 1});
    const Material material = found(cloud);
    EXPECT_EQ(material.method, InsideMethod::Hollows);
    EXPECT_NEAR(volume(material.grid), 1.0, 0.06); // half a voxel all around
    EXPECT_GT(material.spacing, 0.005);
    EXPECT_LT(material.spacing, 0.05);
}

TEST(Material, an_open_sheet_is_a_shell)
{
    Shape sheet;
    for (std::uint32_t i = 0; i <= 8; ++i)
        for (std::uint32_t j = 0; j <= 8; ++j)
        {
            sheet.samples.emplace_back(i / 8.0, j / 8.0, 0.1 + 0.1 * std::sin(1.0 * i));
            if (i > 0 && j > 0)
            {
                const std::uint32_t at = 9 * i + j;
                sheet.triangles.push_back({at, at - 1, at - 10});
                sheet.triangles.push_back({at, at - 10, at - 9});
            }
        }
    EXPECT_EQ(found(sheet).method, InsideMethod::None);
}

TEST(Material, a_tilted_sheet_of_points_encloses_nothing)
{
    std::mt19937 rng(31);
    for (int trial = 0; trial < 2; ++trial)
    {
        const Eigen::Matrix3d Q = support::random_rotation(rng);
        Shape sheet;
        Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
        for (int i = 0; i <= 120; ++i)
            for (int j = 0; j <= 30; ++j)
            {
                sheet.samples.push_back(Q * Eigen::Vector3d(i / 30.0, j / 30.0, 0));
                low = low.cwiseMin(sheet.samples.back());
                high = high.cwiseMax(sheet.samples.back());
            }
        for (Eigen::Vector3d& x : sheet.samples)
            x -= low;
        const Material material = find_material(
            sheet, bounding_surface(sheet),
            grid_shape(high - low, 24, 0, 0.008 / std::sqrt(6.0) * (high - low).norm()),
            Fill::Solid);
        EXPECT_EQ(material.method, InsideMethod::None);
        // A layer about as thick as the points are apart.
        EXPECT_LT(volume(material.grid), 4.0 * 1.0 * 0.1);
    }
}

TEST(Material, an_open_sheet_beside_a_closed_body_holds_together)
{
    // A ball of points with a flat wing.
    std::mt19937 rng(9);
    Shape shape;
    std::normal_distribution<double> normal;
    for (int i = 0; i < 12000; ++i)
        shape.samples.push_back(
            Eigen::Vector3d(1, 1, 1) +
            Eigen::Vector3d(normal(rng), normal(rng), normal(rng)).normalized());
    for (int i = 0; i < 4000; ++i)
        shape.samples.emplace_back(support::random_number(rng, 1.99, 4.0),
                                   support::random_number(rng, 0.5, 1.5), 1.0);
    const GridShape grid = grid_shape({4, 2, 2}, 16, 0, 0.0165);
    const Material material =
        find_material(shape, bounding_surface(shape), grid, Fill::Solid);
    EXPECT_EQ(material.method, InsideMethod::Hollows);
    // No layer on the ball; the wing as thick as its points are apart.
    EXPECT_NEAR(volume(material.grid), 4.0 / 3.0 * std::numbers::pi, 0.35);
    const Octree octree(grid, material_test(material.grid));
    const Cells cells =
        build_cells(material.grid, octree, find_pieces(material.grid, octree));
    int in_wing = 0, glued = 0;
    for (std::size_t c = 0; c < cells.size(); ++c)
        if (cells.cells[c].box_centre.x() > 2.3)
        {
            ++in_wing;
            glued += cells.neighbours_of(static_cast<int>(c)).size() >= 2;
        }
    EXPECT_GT(in_wing, 20);
    EXPECT_GT(glued, 0.9 * in_wing); // a corner may hang by one side
}

TEST(Material, the_points_of_one_cloud_are_one_piece)
{
    // Sparse enough that some points touch others at an edge only.
    const Shape mesh = box_shape({0, 0, 0}, {1, 1, 4});
    for (const int count : {3000, 8000, 20000})
        for (const Fill fill : {Fill::Solid, Fill::Shell})
        {
            const support::Built body = support::built(
                Shape{support::random_points(mesh, count, 8), {}}, 16, 0, fill, 0.02);
            const std::vector<int> part = connected_components(body.cells);
            EXPECT_EQ(*std::max_element(part.begin(), part.end()), 0) << count;
        }
}

TEST(Material, a_shell_is_hollow)
{
    const Material material = found(box_shape({0, 0, 0}, {1, 1, 1}), Fill::Shell);
    EXPECT_FALSE(holds(material, {0.5, 0.5, 0.5}));
    EXPECT_TRUE(holds(material, {0.5, 0.5, 0.0}));
}

TEST(Material, every_sample_lies_in_material)
{
    std::mt19937 rng(4);
    Shape shape;
    for (int i = 0; i < 300; ++i)
        shape.samples.push_back(support::random_vector(rng, 0.5) +
                                Eigen::Vector3d(0.5, 0.5, 0.5));
    for (std::uint32_t i = 0; i + 2 < 90; i += 3)
        shape.triangles.push_back({i, i + 1, i + 2});
    for (const Fill fill : {Fill::Solid, Fill::Shell})
    {
        const Material material = found(shape, fill);
        for (const Eigen::Vector3d& x : shape.samples)
            EXPECT_TRUE(holds(material, x));
    }
}

TEST(Material, a_triangle_marks_all_that_it_crosses)
{
    // Against brute force: voxels that hold one of many points of the triangle.
    std::mt19937 rng(5);
    for (int trial = 0; trial < 20; ++trial)
    {
        SCOPED_TRACE(trial);
        Shape shape;
        for (int k = 0; k < 3; ++k)
            shape.samples.push_back(support::random_vector(rng, 0.5) +
                                    Eigen::Vector3d::Constant(0.5));
        shape.triangles.push_back({0, 1, 2});
        const Material material =
            find_material(shape, bounding_surface(shape),
                          grid_shape({1, 1, 1}, 4, 0, 0.05), Fill::Shell);
        for (const Eigen::Vector3d& x : support::random_points(shape, 5000, 6))
            ASSERT_TRUE(holds(material, x));
        const double area = (shape.samples[1] - shape.samples[0])
                                .cross(shape.samples[2] - shape.samples[0])
                                .norm() /
                            2;
        const double marked = static_cast<double>(
            std::count(material.grid.material().begin(), material.grid.material().end(),
                       std::uint8_t(1)));
        const double voxel = material.grid.shape().voxel();
        // A plane crosses at most three voxels for each voxel face of its area; the
        // rim adds some.
        EXPECT_LT(marked, 3.5 * area / (voxel * voxel) + 12.0 / voxel);
    }
}

TEST(DistanceTransform, is_exact)
{
    std::mt19937 rng(7);
    const Eigen::Vector3i counts(9, 7, 5);
    VoxelFlags marks(9 * 7 * 5);
    for (std::size_t i = 0; i < marks.size(); ++i)
        marks[i] = rng() % 20 == 0;
    const std::vector<float> d = squared_distances(marks, counts);
    const auto place = [&](std::size_t i)
    {
        return Eigen::Vector3i(static_cast<int>(i % 9), static_cast<int>(i / 9 % 7),
                               static_cast<int>(i / 63));
    };
    for (std::size_t i = 0; i < marks.size(); ++i)
    {
        int least = 1 << 30;
        for (std::size_t j = 0; j < marks.size(); ++j)
            if (marks[j])
                least = std::min(least, (place(i) - place(j)).squaredNorm());
        EXPECT_EQ(d[i], static_cast<float>(least));
    }
    const std::vector<float> none = squared_distances(VoxelFlags(8), {2, 2, 2});
    EXPECT_TRUE(std::isinf(none[3]));
}

TEST(PointSpacing, ignores_coincident_points)
{
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 20; ++i)
        for (int j = 0; j < 20; ++j)
            for (int copy = 0; copy < 5; ++copy)
                points.emplace_back(0.1 * i, 0.1 * j, 0.0);
    EXPECT_NEAR(point_spacing(points), 0.14, 0.05);
    EXPECT_EQ(point_spacing(std::vector<Eigen::Vector3d>(100, {1, 2, 3})), 0.0);
}

} // namespace cellwarp::core
