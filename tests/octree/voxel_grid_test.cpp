// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/voxel_grid.h"

#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(VoxelGrid, covers_the_box_exactly)
{
    const VoxelGrid grid(grid_shape({1.0, 0.37, 0.05}, 10, 1, 0.01));
    for (int axis = 0; axis < 3; ++axis)
    {
        EXPECT_EQ(grid.lines(axis).front(), 0.0);
        EXPECT_EQ(grid.lines(axis).back(), grid.shape().size[axis]);
        for (std::size_t i = 1; i < grid.lines(axis).size(); ++i)
            EXPECT_GE(grid.lines(axis)[i], grid.lines(axis)[i - 1]);
    }
    EXPECT_EQ(grid.shape().coarsest, Eigen::Vector3i(10, 4, 1));
}

TEST(VoxelGrid, voxels_inside_the_box_are_no_slivers_and_the_others_have_no_extent)
{
    std::mt19937 rng(5);
    for (int trial = 0; trial < 500; ++trial)
    {
        SCOPED_TRACE(trial);
        const Eigen::Vector3d size(1.0, std::uniform_real_distribution(0.05, 1.0)(rng),
                                   static_cast<double>(rng() % 12 + 1) / 12.0);
        const VoxelGrid grid(grid_shape(size, static_cast<int>(rng() % 20) + 1,
                                        static_cast<int>(rng() % 3), 0.0));
        const VoxelRange inside = grid.inside_box();
        for (int axis = 0; axis < 3; ++axis)
        {
            if (!(size[axis] > grid.shape().voxel()))
                continue;
            // As many at one end as at the other.
            EXPECT_EQ(inside.first[axis], grid.counts()[axis] - 1 - inside.last[axis]);
            for (int i = 0; i < grid.counts()[axis]; ++i)
            {
                const double extent = grid.extent(axis, i) / grid.shape().voxel();
                if (i < inside.first[axis] || i > inside.last[axis])
                    EXPECT_EQ(extent, 0.0);
                else
                {
                    EXPECT_GT(extent,
                              size[axis] > 1.5 * grid.shape().voxel() ? 0.749 : 0.499);
                    EXPECT_LT(extent, 1.751);
                }
            }
            Eigen::Vector3d beyond = 0.5 * size;
            beyond[axis] = size[axis];
            EXPECT_TRUE(inside.contains(grid.locate(beyond)));
            EXPECT_EQ(grid.locate(beyond)[axis], inside.last[axis]);
        }
    }
}

TEST(VoxelGrid, a_point_between_voxels_touches_all_of_them)
{
    const VoxelGrid grid(grid_shape({1, 1, 1}, 4, 0, 0.0));
    const VoxelRange one = grid.touched({0.28, 0.53, 0.97});
    EXPECT_EQ(one.first, one.last);
    const VoxelRange corner = grid.touched({0.25, 0.5, 1.0});
    EXPECT_EQ(corner.first, Eigen::Vector3i(3, 7, 15));
    EXPECT_EQ(corner.last, Eigen::Vector3i(4, 8, 15));
}

TEST(VoxelGrid, a_side_of_whole_leaves_is_cut_into_just_so_many)
{
    EXPECT_EQ(grid_shape({4.0, 1.0, 1.0}, 24, 0, 0.1).coarsest,
              Eigen::Vector3i(24, 6, 6));
    EXPECT_EQ(grid_shape({4.0, 1.0 + 1e-9, 1.0 - 1e-9}, 24, 0, 0.1).coarsest,
              Eigen::Vector3i(24, 6, 6));
}

TEST(VoxelGrid, voxels_are_half_open_and_the_border_belongs_to_the_last)
{
    const VoxelGrid grid(grid_shape({1, 1, 1}, 4, 0, 0.0));
    EXPECT_EQ(grid.counts(), Eigen::Vector3i(16, 16, 16));
    EXPECT_EQ(grid.locate({0, 0, 0}), Eigen::Vector3i(0, 0, 0));
    EXPECT_EQ(grid.locate({0.25, 0.5, 1.0}), Eigen::Vector3i(4, 8, 15));
    EXPECT_EQ(grid.locate({-5, 7, 0.999}), Eigen::Vector3i(0, 15, 15));
}

TEST(VoxelGrid, a_flat_or_point_shape_keeps_a_thickness)
{
    const VoxelGrid flat(grid_shape({1, 1, 0}, 4, 0, 0.0));
    EXPECT_GT(flat.lines(2).back(), flat.lines(2).front());
    const VoxelGrid point(grid_shape({0, 0, 0}, 4, 0, 0.0));
    EXPECT_EQ(point.shape().coarsest, Eigen::Vector3i(1, 1, 1));
    EXPECT_GT(point.lines(0).back(), point.lines(0).front());
}

TEST(VoxelGrid, voxels_are_no_larger_than_asked)
{
    for (const double limit : {0.3, 0.01, 0.004})
        EXPECT_LE(grid_shape({1, 1, 1}, 7, 1, limit).voxel(), limit * (1 + 1e-6));
    EXPECT_EQ(grid_shape({1, 1, 1}, 7, 0, 0.3).voxels_per_leaf, 4);
    EXPECT_EQ(grid_shape({1, 1, 1}, 7, 1, 0.3).voxels_per_leaf, 2);
    EXPECT_EQ(grid_shape({1, 1, 1}, 7, 3, 0.3).voxels_per_leaf, 2);
}

TEST(VoxelGrid, numbers_voxels_and_back)
{
    const VoxelGrid grid(grid_shape({1, 0.5, 0.25}, 4, 0, 0.0));
    for (const std::size_t i : {std::size_t(0), std::size_t(37), grid.size() - 1})
        EXPECT_EQ(grid.index(grid.coordinates(i)), i);
}

TEST(VoxelGrid, numbers_the_finest_boxes_that_hold_its_voxels)
{
    const VoxelGrid grid(grid_shape({1, 0.5, 0.3}, 4, 1, 0.03));
    std::vector<std::size_t> count(grid.num_boxes(), 0);
    for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
    {
        const Eigen::Vector3i v = grid.coordinates(voxel);
        const std::size_t box = grid.box(v);
        ASSERT_LT(box, grid.num_boxes());
        EXPECT_TRUE(grid.voxels_of_box(box).contains(v));
        ++count[box];
    }
    const std::size_t width = idx(grid.shape().voxels_per_leaf);
    for (const std::size_t voxels : count)
        EXPECT_EQ(voxels, width * width * width);
    // Those along x follow each other.
    const int step = grid.shape().voxels_per_leaf;
    EXPECT_EQ(grid.box({step, 0, 0}), grid.box({0, 0, 0}) + 1);
}

} // namespace cellwarp::core
