// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/nearest_sample.h"

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/bodies.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using support::box_shape;
using support::Built;
using support::built;
using support::joined;

constexpr std::uint32_t kNoKind = 0xffffffffu;

/// The kind of each voxel, 1 and above.
std::vector<std::uint32_t> kinds_of_voxels(const NearestSamples& nearest,
                                           const VoxelGrid& grid,
                                           const std::vector<std::uint32_t>& kinds,
                                           std::uint32_t num_kinds)
{
    std::vector<std::uint32_t> found(grid.size(), kNoKind);
    const std::vector<VoxelRuns> voxels = nearest.voxels_of(kinds, num_kinds);
    EXPECT_EQ(voxels.size(), num_kinds);
    EXPECT_TRUE(voxels[0].empty());
    for (std::uint32_t kind = 1; kind < num_kinds; ++kind)
        voxels[kind].for_each(
            [&](std::size_t voxel)
            {
                EXPECT_EQ(found[voxel], kNoKind);
                found[voxel] = kind;
            });
    return found;
}

} // namespace

TEST(NearestSamples, are_measured_through_the_material)
{
    // A U: the tip of one leg is near the other leg, but far through the bend.
    const Shape u = joined(
        joined(box_shape({0, 0, 0}, {4, 0.4, 1}), box_shape({0, 0.6, 0}, {4, 1, 1})),
        box_shape({0, 0, 0}, {0.4, 1, 1}));
    const Built body = built(u, 8, 0, Fill::Solid, 0.05);
    const std::vector<Eigen::Vector3d> samples = {{4, 0.2, 0.5}, {0, 1, 0.5}};
    const VoxelGrid& grid = body.material.grid;
    const NearestSamples nearest(grid, samples, {}, {});
    const std::vector<std::uint32_t> kinds = kinds_of_voxels(nearest, grid, {1, 2}, 3);
    EXPECT_EQ(kinds[grid.index(grid.locate({3.9, 0.2, 0.5}))], 1u);
    EXPECT_EQ(kinds[grid.index(grid.locate({3.9, 0.8, 0.5}))], 2u);
    for (std::size_t i = 0; i < grid.size(); ++i)
        EXPECT_EQ(kinds[i] == kNoKind, !grid.material()[i]);
    // Samples of kind 0 are left out.
    const std::vector<std::uint32_t> second = kinds_of_voxels(nearest, grid, {0, 1}, 2);
    for (std::size_t i = 0; i < grid.size(); ++i)
        EXPECT_EQ(second[i] == 1, kinds[i] == 2);
}

TEST(NearestSamples, are_those_of_straight_lines_in_convex_shapes)
{
    // From a few samples to some in every block; kinds side by side, and mixed.
    for (const int n : {1, 3, 12, 24})
        for (const bool is_mixed : {false, true})
        {
            const Shape shape = box_shape({0, 0, 0}, {2, 1, 1.5}, n);
            const Built body = built(shape, 12, 1, Fill::Solid, 0.03);
            const VoxelGrid& grid = body.material.grid;
            std::mt19937 rng(3);
            std::vector<std::uint32_t> kinds;
            for (const Eigen::Vector3d& x : shape.samples)
                kinds.push_back(static_cast<std::uint32_t>(
                    1 + (is_mixed ? rng() % 3 : std::lround(x.x() + 0.7 * x.y()))));
            const std::vector<std::uint32_t> found = kinds_of_voxels(
                NearestSamples(grid, shape.samples, {}, {}), grid, kinds, 5);
            std::size_t num_wrong = 0, num_voxels = 0;
            for (std::size_t voxel = 0; voxel < grid.size(); voxel += 31)
            {
                if (!grid.material()[voxel])
                    continue;
                ASSERT_NE(found[voxel], kNoKind);
                const Eigen::Vector3d x = grid.centre(grid.coordinates(voxel));
                double of_found = INFINITY, least = INFINITY;
                for (std::size_t i = 0; i < kinds.size(); ++i)
                {
                    const double d = (shape.samples[i] - x).norm();
                    least = std::min(least, d);
                    if (kinds[i] == found[voxel])
                        of_found = std::min(of_found, d);
                }
                ++num_voxels;
                num_wrong += of_found > least + 1e-3 * grid.shape().voxel();
                EXPECT_LT(of_found, least + 0.5 * grid.shape().voxel());
            }
            // Deep inside, where samples on all sides are as far away, a few are taken
            // for nearest that are farther by a part of a voxel.
            EXPECT_LT(num_wrong, num_voxels / (is_mixed ? 20 : 200)) << n;
        }
}

TEST(NearestSamples, of_equal_distances_the_first_counts)
{
    const Shape shape = box_shape({0, 0, 0}, {2, 1, 1}, 1);
    const Built body = built(shape, 9, 0, Fill::Solid, 2.0 / 45.0);
    const VoxelGrid& grid = body.material.grid;
    for (const bool is_swapped : {false, true})
    {
        std::vector<Eigen::Vector3d> samples = {{0, 0.5, 0.5}, {2, 0.5, 0.5}};
        if (is_swapped)
            std::swap(samples[0], samples[1]);
        const std::vector<std::uint32_t> found =
            kinds_of_voxels(NearestSamples(grid, samples, {}, {}), grid, {1, 2}, 3);
        std::size_t num_between = 0;
        for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
        {
            if (!grid.material()[voxel])
                continue;
            const double x = grid.centre(grid.coordinates(voxel)).x();
            const bool is_between = std::abs(x - 1.0) < 1e-9;
            num_between += is_between;
            EXPECT_EQ(found[voxel],
                      is_between || (samples[0].x() < 1.0) == (x < 1.0) ? 1u : 2u);
        }
        EXPECT_GT(num_between, 100u);
    }
}

TEST(NearestSamples, reach_no_farther_than_the_material)
{
    // A sample at each of two boxes, and a box without one.
    const Shape boxes =
        joined(joined(box_shape({0, 0, 0}, {1, 1, 1}), box_shape({1.3, 0, 0}, {2, 1, 1})),
               box_shape({2.3, 0, 0}, {3, 1, 1}));
    const Built body = built(boxes, 12, 0, Fill::Solid, 0.01);
    const VoxelGrid& grid = body.material.grid;
    const std::vector<Eigen::Vector3d> samples = {{0.5, 0, 0}, {1.3, 1, 1}};
    const std::vector<std::uint32_t> found =
        kinds_of_voxels(NearestSamples(grid, samples, {}, {}), grid, {1, 2}, 3);
    for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
    {
        const double x = grid.centre(grid.coordinates(voxel)).x();
        EXPECT_EQ(found[voxel], !grid.material()[voxel] || x > 2.2 ? kNoKind
                                : x < 1.2                          ? 1u
                                                                   : 2u);
    }
}

} // namespace cellwarp::core
