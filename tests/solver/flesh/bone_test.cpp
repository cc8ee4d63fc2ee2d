// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>

#include <gtest/gtest.h>

#include "solver/flesh/bone_points.h"
#include "solver/flesh/bone_tube.h"
#include "tests/support/flesh.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

const auto kEverywhere = [](int, const Vector3d&) { return true; };

} // namespace

TEST(BonePoints, are_the_joints_first_and_then_the_crossings_along_each_bone)
{
    const Lattice lattice = support::bar_lattice(1, 4);
    const std::vector<BoneLine> bones = {{{0.5, 0.4, 0.6}, {2.5, 0.4, 0.6}, 3},
                                         {{2.5, 0.4, 0.6}, {3.5, 0.4, 0.6}, 4}};
    const std::vector<HeldPoint> points = points_on_bones(lattice, bones, kEverywhere);
    std::vector<double> at;
    for (const HeldPoint& point : points)
    {
        at.push_back(point.place.x());
        Vector3d sum = Vector3d::Zero();
        for (const NodeShare& share : point.shares)
            sum += share.share * lattice.places[idx(share.node)];
        EXPECT_LT((sum - point.place).norm(), 1e-14);
    }
    EXPECT_EQ(at, (std::vector<double>{0.5, 2.5, 3.5, 1.0, 2.0, 3.0}));
    EXPECT_EQ(points[0].motion, 3);
    EXPECT_EQ(points[1].motion, 3); // the joint of both, once
    EXPECT_EQ(points[2].motion, 4);
}

TEST(BonePoints, outside_the_material_a_bone_holds_nothing)
{
    const Lattice lattice = support::bar_lattice(1, 4);
    const std::vector<BoneLine> bones = {{{-2.0, 0.5, 0.5}, {6.0, 0.5, 0.5}, 0},
                                         {{0.5, 3.0, 0.5}, {3.5, 3.0, 0.5}, 1}};
    const std::vector<HeldPoint> points = points_on_bones(lattice, bones, kEverywhere);
    EXPECT_EQ(points.size(), 5u); // where it enters, crosses and leaves
    // Cells that say that the material is not theirs.
    const auto in_two = [](int cell, const Vector3d&) { return cell == 2; };
    EXPECT_EQ(points_on_bones(lattice, bones, in_two).size(), 2u);
}

TEST(BonePoints, cross_bent_cells_where_straight_ones_do)
{
    const Lattice straight = support::bar_lattice(2, 3);
    Lattice drawn =
        support::grid_lattice({{{0, .5, 1, 1.5, 2, 2.5, 3}, {0, .5, 1}, {0, .5, 1}}});
    const std::vector<BoneLine> bones = {{{0.2, 0.3, 0.8}, {2.9, 0.7, 0.1}, 0}};
    const auto places = [&](const Lattice& lattice)
    {
        std::vector<Vector3d> all;
        for (const HeldPoint& point : points_on_bones(lattice, bones, kEverywhere))
            all.push_back(point.place);
        return all;
    };
    const std::vector<Vector3d> a = places(straight), b = places(drawn);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t k = 0; k < a.size(); ++k)
        EXPECT_LT((a[k] - b[k]).norm(), 1e-9);
}

TEST(BoneTube, has_the_voxels_near_a_bone_that_the_material_joins_to_it)
{
    // Two slabs side by side: the bone lies in the lower one, its tube reaches the upper.
    const Shape shape = support::joined(support::box_shape({0, 0, 0}, {4, 1, 0.9}),
                                        support::box_shape({0, 0, 1.1}, {4, 1, 2}));
    const support::Built body = support::built(shape, 8, 0, Fill::Solid, 0.05);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    const std::vector<TubeBone> bones = {{{{0.5, 0.5, 0.6}, {3.5, 0.5, 0.6}, 0}, 0.8}};
    const auto points = points_in_tubes(body.material.grid, body.pieces, lattice, 1.0,
                                        voxels_in_tubes(body.material.grid, 1.0, bones));
    double volume = 0.0;
    for (const MaterialPoint& point : points[0])
    {
        volume += point.volume;
        const Vector3d x = cell_point(lattice, point.cell, point.local);
        EXPECT_LT(x.z(), 0.9 + 1e-9);
    }
    EXPECT_GT(volume, 2.0);
    EXPECT_LT(volume, 4 * 0.9);
}

TEST(BoneTube, of_several_bones_the_nearest_has_a_voxel)
{
    const support::Built body =
        support::built(support::box_shape({0, 0, 0}, {4, 1, 1}), 8, 0, Fill::Solid, 0.05);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    const std::vector<TubeBone> bones = {{{{0, 0.5, 0.5}, {2, 0.5, 0.5}, 0}, 0.4},
                                         {{{2, 0.5, 0.5}, {4, 0.5, 0.5}, 1}, 0.4}};
    const auto points = points_in_tubes(body.material.grid, body.pieces, lattice, 1.0,
                                        voxels_in_tubes(body.material.grid, 1.0, bones));
    double volume[2] = {0.0, 0.0};
    for (int b = 0; b < 2; ++b)
        for (const MaterialPoint& point : points[idx(b)])
        {
            volume[b] += point.volume;
            const double x = cell_point(lattice, point.cell, point.local).x();
            EXPECT_TRUE(b == 0 ? x < 2.0 : x > 2.0) << x;
        }
    EXPECT_NEAR(volume[0], volume[1], 1e-9);
    // A cylinder, to the width of the voxels.
    EXPECT_NEAR(volume[0], 3.14159 * 0.16 * 2.0, 0.05);
    const auto parts = tube_parts(lattice, std::vector<FleshMaterial>{{1e4, 0.25, 1000}},
                                  bones, points, 10.0);
    double overlap = 0.0;
    for (const TubePart& part : parts)
    {
        overlap += part.overlap.sum();
        EXPECT_NEAR(part.stiffness, 10.0 * 4e3 / 0.16, 1e-6);
    }
    EXPECT_NEAR(overlap, volume[0] + volume[1], 1e-9);
}

} // namespace cellwarp::core
