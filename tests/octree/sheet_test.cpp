// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/sheet.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "octree/cells.h"
#include "tests/support/bodies.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::random_rotation;

namespace
{

constexpr double kThickness = 0.04;

/// 3 x 2, turned and moved so that its box begins at 0.
Shape sheet(const Eigen::Matrix3d& R, int quads)
{
    return support::turned(support::sheet_shape(3.0, 2.0, quads), R);
}

struct Cut
{
    Material material;
    Sheets sheets;
    Cells cells;
};
Cut cut(const Shape& shape, int across, int depth = 0, double max_voxel = 0.0)
{
    Eigen::Vector3d high = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& x : shape.samples)
        high = high.cwiseMax(x);
    const GridShape grid = grid_shape(high, across, depth, max_voxel);
    Material material = find_material(shape, bounding_surface(shape), grid, Fill::Shell);
    Sheets sheets = find_sheets(shape, bounding_surface(shape), material, kThickness);
    const MaterialTest test = material_test(material.grid);
    const Octree octree = Octree(grid, test).split_all(depth, test);
    Cells cells = build_cells(material.grid, octree, find_pieces(material.grid, octree),
                              material.is_sheet, sheets);
    return {std::move(material), std::move(sheets), std::move(cells)};
}

double area_of(const Sheets& sheets)
{
    double area = 0.0;
    for (const SheetPatch& patch : sheets.patches)
        area += patch.area;
    return area;
}

/// Of each axis the volume of all cross-sections times the distance of their planes.
Eigen::Vector3d volumes_of(const Cells& cells)
{
    Eigen::Vector3d volumes = Eigen::Vector3d::Zero();
    for (const Face& face : cells.faces)
        volumes[face.axis] += face.area * face.distance;
    return volumes;
}

} // namespace

TEST(Sheet, has_its_own_area_however_it_lies)
{
    std::mt19937 rng(1);
    for (int trial = 0; trial < 10; ++trial)
        for (const int quads : {1, 37})
            EXPECT_NEAR(area_of(cut(sheet(random_rotation(rng), quads), 12).sheets), 6.0,
                        1e-9);
}

TEST(Sheet, has_the_same_parts_for_every_number_of_threads)
{
    std::mt19937 rng(8);
    const Shape mesh = sheet(random_rotation(rng), 30);
    for (const Shape& shape : {mesh, Shape{mesh.samples, {}}})
    {
        const Sheets all = cut(shape, 12).sheets;
        const ThreadLimit one(1);
        const Sheets alone = cut(shape, 12).sheets;
        ASSERT_EQ(all.patches.size(), alone.patches.size());
        ASSERT_EQ(all.crossings.size(), alone.crossings.size());
        EXPECT_GT(all.crossings.size(), 1000u);
        for (std::size_t i = 0; i < all.crossings.size(); ++i)
            ASSERT_TRUE(all.crossings[i].below == alone.crossings[i].below &&
                        all.crossings[i].area == alone.crossings[i].area &&
                        all.crossings[i].centre == alone.crossings[i].centre);
        for (std::size_t i = 0; i < all.patches.size(); ++i)
            ASSERT_EQ(all.patches[i].centre, alone.patches[i].centre);
    }
}

TEST(Sheet, of_a_line_is_a_bar_as_wide_as_it_is_thick_however_it_lies)
{
    std::mt19937 rng(9);
    for (int trial = 0; trial < 10; ++trial)
        for (const int parts : {1, 7})
        {
            const Eigen::Matrix3d R = random_rotation(rng);
            Shape shape;
            for (int k = 0; k <= parts; ++k)
            {
                shape.samples.push_back(R * Eigen::Vector3d(3.0 * k / parts, 0, 0));
                if (k > 0)
                    shape.lines.push_back({std::uint32_t(k), std::uint32_t(k - 1)});
            }
            shape = support::turned(shape, Eigen::Matrix3d::Identity());
            const Cut whole = cut(shape, 40);
            EXPECT_NEAR(area_of(whole.sheets), 3.0 * kThickness, 1e-9);
            // The same volume in the cross-sections along the axis that it lies along.
            int axis = 0;
            R.col(0).cwiseAbs().maxCoeff(&axis);
            EXPECT_NEAR(volumes_of(whole.cells)[axis], 3.0 * kThickness * kThickness,
                        0.06 * 3.0 * kThickness * kThickness);
            EXPECT_EQ(std::ranges::max(connected_components(whole.cells)), 0);
            // It bends to all sides alike.
            for (const SheetCrossing& crossing : whole.sheets.crossings)
            {
                EXPECT_NEAR(crossing.normal.dot(R.col(0)), 0.0, 1e-12);
                EXPECT_NEAR(crossing.length, kThickness, 1e-12);
            }
        }
}

TEST(Sheet, crosses_a_plane_in_one_part_or_in_halves_where_a_corner_lies_on_it)
{
    // In a box of edge 1 with leaves of 0.5; the plane x = 0.5 cuts the triangle.
    for (const double tip : {0.2, 0.5})
    {
        const Shape shape{
            {{0.2, 0.1, 0.2}, {0.8, 0.1, 0.2}, {tip, 0.1, 0.4}, {0, 0, 0}, {1, 1, 1}},
            {{0, 1, 2}}};
        const Sheets sheets = cut(shape, 2).sheets;
        ASSERT_EQ(sheets.crossings.size(), tip == 0.5 ? 2u : 1u);
        const double length = tip == 0.5 ? 0.2 : 0.1;
        double area = 0.0;
        for (const SheetCrossing& crossing : sheets.crossings)
        {
            EXPECT_EQ(crossing.axis, 0);
            EXPECT_NEAR(crossing.length, length, 1e-12);
            area += crossing.area;
        }
        EXPECT_NEAR(area, length * kThickness, 1e-12);
        EXPECT_EQ(sheets.patches.size(), 2u);
        EXPECT_NEAR(area_of(sheets), 0.06, 1e-12);
    }
}

TEST(Sheet, has_cross_sections_of_its_own_volume_however_it_lies)
{
    std::mt19937 rng(2);
    for (int trial = 0; trial < 10; ++trial)
    {
        const Eigen::Matrix3d R = random_rotation(rng);
        const Eigen::Vector3d volumes = volumes_of(cut(sheet(R, 20), 40).cells);
        for (int axis = 0; axis < 3; ++axis)
        {
            // Planes that lie nearly in the sheet have few crossings to average over.
            const double tolerance = std::abs(R(axis, 2)) < 0.8 ? 0.05 : 1.0;
            EXPECT_NEAR(volumes[axis] / (6.0 * kThickness), 1.0, tolerance) << axis;
        }
    }
}

TEST(Sheet, has_cross_sections_of_its_own_volume_in_cells_smaller_than_it_is_thick)
{
    // Leaves of 0.0125 at the deepest level, and a thickness of 0.04.
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 0).normalized()).matrix();
    const Eigen::Vector3d volumes = volumes_of(cut(sheet(R, 20), 60, 2).cells);
    for (int axis = 0; axis < 2; ++axis)
        EXPECT_NEAR(volumes[axis], 6.0 * kThickness, 0.05 * 6.0 * kThickness) << axis;
}

TEST(Sheet, in_a_plane_between_cells_belongs_to_both_sides)
{
    // Two crossed sheets put the middle of the box, and so that of the first, between
    // the two middle layers of cells.
    Shape shape = sheet(Eigen::Matrix3d::Identity(), 6);
    for (Eigen::Vector3d& x : shape.samples)
        x.z() += 0.75;
    Shape ends = shape;
    for (Eigen::Vector3d& x : ends.samples)
        x = Eigen::Vector3d(0.0, x.y(), 0.5 * x.x());
    const Cut both = cut(support::joined(shape, ends), 12);
    double below = 0.0, above = 0.0, across = 0.0;
    for (std::size_t c = 0; c < both.cells.size(); ++c)
        EXPECT_TRUE(both.cells.cells[c].middle.allFinite());
    for (const SheetPatch& patch : both.sheets.patches)
        if (patch.centre.x() > 1e-6)
            (both.material.grid.centre(both.material.grid.coordinates(patch.voxel)).z() <
                     0.75
                 ? below
                 : above) += patch.area;
    for (const SheetCrossing& crossing : both.sheets.crossings)
        if (crossing.axis == 2 && crossing.centre.x() > 1e-6)
            across += crossing.area;
    EXPECT_NEAR(below + above, 6.0, 1e-9);
    if (below > 1.0) // where the voxels of both sides are marked
    {
        EXPECT_NEAR(below, above, 1e-9);
        EXPECT_NEAR(across, 6.0, 1e-9);
    }
}

TEST(Sheet, of_points_has_nearly_the_area_of_the_surface)
{
    std::mt19937 rng(3);
    Shape cloud;
    cloud.samples = support::random_points(sheet(random_rotation(rng), 1), 12000, 4);
    // A tenth more: what is said of points at the rim.
    EXPECT_NEAR(area_of(cut(cloud, 16, 0, 0.02).sheets), 6.0, 0.6);
}

TEST(Sheet, of_a_triangle_that_is_there_twice_counts_once)
{
    std::mt19937 rng(5);
    Shape shape = sheet(random_rotation(rng), 8);
    const double once = area_of(cut(shape, 12).sheets);
    const std::vector<Triangle> copy = shape.triangles;
    for (const Triangle& t : copy)
        shape.triangles.push_back({t[0], t[2], t[1]});
    EXPECT_NEAR(area_of(cut(shape, 12).sheets), once, 1e-9);
}

TEST(Sheet, is_not_what_bounds_an_inside)
{
    const Shape box = support::box_shape({0, 0, 0}, {1, 1, 1}, 4);
    const Material closed = find_material(box, bounding_surface(box),
                                          grid_shape({1, 1, 1}, 8, 0, 0.03), Fill::Solid);
    EXPECT_TRUE(closed.is_sheet.empty());
    // Beside an open sheet only that is one.
    Shape both = support::sheet_shape(3.0, 1.0, 24);
    for (Eigen::Vector3d& x : both.samples)
        x += Eigen::Vector3d(0, 2, 0.513);
    both = support::joined(box, both);
    const Material material = find_material(
        both, bounding_surface(both), grid_shape({3, 3, 1}, 24, 0, 0.03), Fill::Solid);
    ASSERT_FALSE(material.is_sheet.empty());
    const VoxelGrid& grid = material.grid;
    std::size_t sheets = 0;
    for (std::size_t i = 0; i < grid.size(); ++i)
        if (grid.material()[i])
        {
            const bool is_beside = grid.centre(grid.coordinates(i)).y() > 1.5;
            EXPECT_EQ(material.is_sheet[i] != 0, is_beside);
            sheets += is_beside;
        }
    EXPECT_GT(sheets, 1000u);
}

} // namespace cellwarp::core
