// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/notches.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "octree/cells.h"
#include "octree/material.h"
#include "octree/pieces.h"
#include "tests/support/bodies.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::Vector3i;

Vector3d size_of(const Shape& shape)
{
    Vector3d high = Vector3d::Zero();
    for (const Vector3d& x : shape.samples)
        high = high.cwiseMax(x);
    return high;
}

struct Found
{
    Material material;
    Notches notches;
};
Found found(const Shape& shape, int across, Fill fill = Fill::Solid)
{
    const BoundingSurface surface = bounding_surface(shape);
    Material material =
        find_material(shape, surface, grid_shape(size_of(shape), across, 0, 0.0), fill);
    Notches notches = find_notches(shape, surface, material.grid);
    return {std::move(material), std::move(notches)};
}

Cells cells_of(const Found& of, bool has_notches = true)
{
    const VoxelGrid& grid = of.material.grid;
    const Octree octree(grid.shape(), material_test(grid));
    const Notches none;
    const Notches& notches = has_notches ? of.notches : none;
    return build_cells(grid, octree, find_pieces(grid, octree, notches), {}, {}, notches);
}

/// Whether a point of the comb's own space is in it; \p margin: by how much at least, or
/// if it is negative, how far outside still counts.
bool is_in_comb(const Vector3d& x, double margin)
{
    const auto between = [&](double at, double low, double high)
    { return at > low + margin && at < high - margin; };
    return between(x.x(), 0, 4) && between(x.y(), 0, 1) && between(x.z(), 0, 1) &&
           !(x.x() > 1.98 - margin && x.y() > 0.45 - margin && x.y() < 0.55 + margin);
}

/// Calls visit(voxel, axis, points) for all sides between voxels of one material, with
/// points all over the side, in the units of the grid.
void for_each_side(
    const VoxelGrid& grid,
    const std::function<void(std::size_t, int, const std::vector<Vector3d>&)>& visit)
{
    for_each_set(grid.material(),
                 [&](std::size_t voxel)
                 {
                     const Vector3i at = grid.coordinates(voxel);
                     for (int axis = 0; axis < 3; ++axis)
                     {
                         Vector3i next = at;
                         ++next[axis];
                         if (!grid.contains(next) ||
                             grid.material()[grid.index(next)] != grid.material()[voxel])
                             continue;
                         std::vector<Vector3d> points;
                         for (int i = 0; i <= 8; ++i)
                             for (int j = 0; j <= 8; ++j)
                             {
                                 Vector3d x = at.cast<double>();
                                 x[axis] += 1.0;
                                 x[(axis + 1) % 3] += i / 8.0;
                                 x[(axis + 2) % 3] += j / 8.0;
                                 points.push_back(grid.from_voxels(x));
                             }
                         visit(voxel, axis, points);
                     }
                 });
}

} // namespace

TEST(Notches, open_sides_are_those_that_lie_outside_as_a_whole)
{
    std::mt19937 rng(1);
    int num_open = 0;
    for (int trial = 0; trial < 12; ++trial)
    {
        // Every third one is a mirror image.
        Eigen::Matrix3d R = support::random_rotation(rng);
        if (trial % 3 == 2)
            R.col(0) *= -1.0;
        const Shape comb = support::turned(support::comb(), R);
        const Vector3d corner = comb.samples[0] - R * support::comb().samples[0];
        const Found of = found(comb, 14 + trial);
        for_each_side(
            of.material.grid,
            [&](std::size_t voxel, int axis, const std::vector<Vector3d>& points)
            {
                const auto all_outside = [&](double margin)
                {
                    return std::ranges::none_of(
                        points, [&](const Vector3d& x)
                        { return is_in_comb(R.transpose() * (x - corner), margin); });
                };
                if (of.notches.is_open(voxel, axis))
                {
                    ++num_open;
                    EXPECT_TRUE(all_outside(1e-9));
                }
                // A corner of the comb may reach in between the points.
                else
                    EXPECT_FALSE(all_outside(-0.04));
            });
    }
    EXPECT_GT(num_open, 1000);
}

TEST(Notches, the_teeth_of_a_comb_are_told_apart_though_their_voxels_touch)
{
    // Voxels of 1/12: the walls of the slit lie in two beside each other, in one leaf.
    const Found of = found(support::comb(), 12);
    const auto num_on_both_sides = [](const Cells& cells)
    {
        return std::ranges::count_if(
            cells.cells, [](const Cell& cell)
            { return cell.centre.x() > 2.1 && std::abs(cell.centre.y() - 0.5) < 0.05; });
    };
    EXPECT_GT(num_on_both_sides(cells_of(of, false)), 0);
    const Cells cells = cells_of(of);
    EXPECT_EQ(num_on_both_sides(cells), 0);
    EXPECT_EQ(std::ranges::max(connected_components(cells)), 0);
    double volume = 0.0, volume_before = 0.0;
    for (const Cell& cell : cells.cells)
        volume += cell.volume;
    for (const Cell& cell : cells_of(of, false).cells)
        volume_before += cell.volume;
    EXPECT_NEAR(volume, volume_before, 1e-12);
}

TEST(Notches, convex_and_thin_shapes_have_none)
{
    std::mt19937 rng(2);
    for (int trial = 0; trial < 8; ++trial)
    {
        const Eigen::Matrix3d R = support::random_rotation(rng);
        for (const double thickness : {1.0, 0.02})
        {
            const Shape box = support::turned(
                support::box_shape({0, 0, 0}, {4, 1, thickness}, trial % 2 ? 1 : 9), R);
            EXPECT_TRUE(found(box, 16).notches.empty());
        }
    }
}

TEST(Notches, only_of_closed_surfaces)
{
    Shape comb = support::comb();
    EXPECT_FALSE(found(comb, 12).notches.empty());
    comb.triangles.pop_back();
    EXPECT_TRUE(found(comb, 12).notches.empty());
    EXPECT_TRUE(found(Shape{comb.samples, {}}, 12).notches.empty());
}

TEST(Notches, are_the_same_for_every_number_of_threads)
{
    std::mt19937 rng(3);
    const Shape comb = support::turned(support::comb(), support::random_rotation(rng));
    const VoxelFlags all = found(comb, 40).notches.open_sides();
    const ThreadLimit one(1);
    EXPECT_EQ(found(comb, 40).notches.open_sides(), all);
}

TEST(Notches, pieces_taken_over_from_another_octree_are_as_made_from_nothing)
{
    std::mt19937 rng(4);
    const Shape comb = support::turned(support::comb(), support::random_rotation(rng));
    const BoundingSurface surface = bounding_surface(comb);
    const GridShape shape = grid_shape(size_of(comb), 8, 2, 0.0);
    const Material material = find_material(comb, surface, shape, Fill::Solid);
    const Notches notches = find_notches(comb, surface, material.grid);
    ASSERT_FALSE(notches.empty());
    const MaterialTest test = material_test(material.grid);
    const Octree coarse(shape, test);
    const Octree fine = coarse.split_all(1, test);
    const Pieces before = find_pieces(material.grid, coarse, notches);
    // And back, so that both kinds of change are there.
    for (const Octree* to : {&fine, &coarse})
    {
        const Pieces fresh = find_pieces(material.grid, *to, notches);
        const Pieces taken = find_pieces(material.grid, *to, notches, coarse, before);
        ASSERT_EQ(taken.size(), fresh.size());
        for_each_set(material.grid.material(),
                     [&](std::size_t voxel) {
                         ASSERT_EQ(taken.at(material.grid, voxel),
                                   fresh.at(material.grid, voxel));
                     });
    }
    EXPECT_GT(find_pieces(material.grid, fine, notches).size(),
              find_pieces(material.grid, fine).size());
}

} // namespace cellwarp::core
