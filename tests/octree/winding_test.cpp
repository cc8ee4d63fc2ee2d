// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/winding.h"

#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/bounding_surface.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

/// A box in the grid's, turned at random.
Shape turned_box(std::mt19937& rng, const Eigen::Vector3d& size)
{
    const Eigen::Vector3d half = 0.22 * size;
    Shape box = support::box_shape(-half, half, 2);
    const Eigen::Quaterniond turn(
        Eigen::Vector4d(support::random_vector(rng, 1.0).homogeneous()).normalized());
    const Eigen::Vector3d middle =
        0.5 * size + 0.2 * size.cwiseProduct(support::random_vector(rng, 1.0));
    for (Eigen::Vector3d& x : box.samples)
        x = middle + 0.6 * (turn * x);
    return box;
}

Shape without_face(Shape box, int axis, double at)
{
    std::erase_if(box.triangles,
                  [&](const Triangle& t)
                  {
                      return std::all_of(t.begin(), t.end(),
                                         [&](std::uint32_t corner)
                                         { return box.samples[corner][axis] == at; });
                  });
    return box;
}

} // namespace

TEST(Winding, of_a_place_is_one_in_a_box_none_beside_it_and_less_inside_out)
{
    Shape box = support::box_shape({0, 0, 0}, {1, 2, 3}, 3);
    std::mt19937 rng(8);
    for (int trial = 0; trial < 50; ++trial)
    {
        const Eigen::Vector3d in(support::random_number(rng, 0.01, 0.99),
                                 support::random_number(rng, 0.01, 1.99),
                                 support::random_number(rng, 0.01, 2.99));
        EXPECT_NEAR(winding_number(box, box.triangles, in), 1.0, 1e-12);
        EXPECT_NEAR(winding_number(box, box.triangles, in + Eigen::Vector3d(0, 2, 0)),
                    0.0, 1e-12);
    }
    for (Triangle& triangle : box.triangles)
        std::swap(triangle[1], triangle[2]);
    EXPECT_NEAR(winding_number(box, box.triangles, {0.5, 0.5, 0.5}), -1.0, 1e-12);
}

TEST(Winding, of_closed_shapes_is_that_of_their_solid_angles)
{
    // Of three different counts, so that no two axes can be mistaken for each other.
    const GridShape shape = grid_shape({1, 0.7, 0.45}, 5, 0, 0.03);
    const VoxelGrid grid(shape);
    std::mt19937 rng(4);
    for (int trial = 0; trial < 12; ++trial)
    {
        // One, two that overlap, and one inside out.
        Shape some = turned_box(rng, shape.size);
        if (trial % 3 > 0)
            some = support::joined(some, turned_box(rng, shape.size));
        if (trial % 3 == 2)
            for (Triangle& t : some.triangles)
                std::swap(t[1], t[2]);
        const VoxelFlags is_inside = inside_by_winding(some, some.triangles, grid);
        const VoxelFlags votes = inside_votes(some, some.triangles, grid);
        std::size_t num_inside = 0;
        for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
        {
            // Of the whole voxel, also where the box ends within it.
            const Eigen::Vector3d x =
                grid.from_voxels(grid.coordinates(voxel).cast<double>().array() + 0.5);
            const bool is_in = std::abs(winding_number(some, some.triangles, x)) > 0.5;
            num_inside += is_in;
            ASSERT_EQ(is_inside[voxel] != 0, is_in) << trial << ' ' << x.transpose();
            ASSERT_EQ(int(votes[voxel]), is_in ? 6 : 0) << trial;
        }
        EXPECT_GT(num_inside, 20u);
    }
}

TEST(Winding, of_sides_is_that_of_their_middles)
{
    const GridShape shape = grid_shape({1, 0.7, 0.45}, 5, 0, 0.03);
    const VoxelGrid grid(shape);
    std::mt19937 rng(6);
    const Shape box = turned_box(rng, shape.size);
    for (int axis = 0; axis < 3; ++axis)
    {
        std::vector<std::size_t> voxels;
        for (std::size_t voxel = rng() % 7; voxel < grid.size(); voxel += 1 + rng() % 7)
            if (grid.coordinates(voxel)[axis] + 1 < grid.inside_box().last[axis])
                voxels.push_back(voxel);
        const std::vector<char> is_inside =
            sides_inside(box, box.triangles, grid, axis, voxels);
        std::size_t num_inside = 0;
        for (std::size_t k = 0; k < voxels.size(); ++k)
        {
            Eigen::Vector3d at = grid.coordinates(voxels[k]).cast<double>().array() + 0.5;
            at[axis] += 0.5;
            const Eigen::Vector3d x = grid.from_voxels(at);
            const bool is_in = std::abs(winding_number(box, box.triangles, x)) > 0.5;
            num_inside += is_in;
            ASSERT_EQ(is_inside[k] != 0, is_in) << axis << ' ' << x.transpose();
        }
        EXPECT_GT(num_inside, 10u);
    }
    EXPECT_TRUE(sides_inside(box, box.triangles, grid, 0, {}).empty());
}

TEST(Winding, votes_of_a_box_without_a_face_do_not_hang_on_where_it_is_missing)
{
    const GridShape shape = grid_shape({1, 1, 1}, 3, 0, 0.05);
    const VoxelGrid grid(shape);
    const Shape box = support::box_shape({0.21, 0.21, 0.21}, {0.79, 0.79, 0.79}, 2);
    std::size_t first = 0;
    for (int axis = 0; axis < 3; ++axis)
        for (const double at : {0.21, 0.79})
        {
            const Shape open = without_face(box, axis, at);
            ASSERT_LT(open.triangles.size(), box.triangles.size());
            const VoxelFlags votes = inside_votes(open, open.triangles, grid);
            std::size_t count = 0;
            for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
                count += votes[voxel] > 3;
            if (first == 0)
                first = count;
            EXPECT_EQ(count, first) << axis << ' ' << at;
        }
    EXPECT_GT(first, 100u);
}

TEST(Winding, of_nothing_is_nothing)
{
    const VoxelGrid grid(grid_shape({1, 1, 1}, 2, 0, 0.1));
    const VoxelFlags is_inside = inside_by_winding({}, {}, grid);
    EXPECT_TRUE(is_inside.is_zero(0, is_inside.size()));
    const VoxelFlags votes = inside_votes({}, {}, grid);
    EXPECT_TRUE(votes.is_zero(0, votes.size()));
}

} // namespace cellwarp::core
