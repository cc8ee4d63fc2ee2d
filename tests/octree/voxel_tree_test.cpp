// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/voxel_tree.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

/// Different ones, around a place.
std::vector<Eigen::Vector3i> random_voxels(std::mt19937& rng, int count, int width,
                                           const Eigen::Vector3i& first)
{
    std::vector<Eigen::Vector3i> voxels;
    const auto number = [&] { return static_cast<int>(rng() % unsigned(width)); };
    while (static_cast<int>(voxels.size()) < count)
    {
        const Eigen::Vector3i voxel =
            first + Eigen::Vector3i(number(), number(), number());
        if (std::find(voxels.begin(), voxels.end(), voxel) == voxels.end())
            voxels.push_back(voxel);
    }
    return voxels;
}

} // namespace

TEST(VoxelTree, finds_what_comparing_all_with_all_finds)
{
    std::mt19937 rng(5);
    for (int trial = 0; trial < 60; ++trial)
    {
        SCOPED_TRACE(trial);
        const int width = 4 + trial % 9;
        const auto a = random_voxels(rng, 1 + trial % 50, width, {0, 0, 0});
        std::vector<Eigen::Vector3i> b =
            random_voxels(rng, 1 + trial % 37, width, {trial % 7, trial % 4 - 2, 5});
        std::erase_if(b, [&](const Eigen::Vector3i& voxel)
                      { return std::find(a.begin(), a.end(), voxel) != a.end(); });
        if (b.empty())
            continue;
        const VoxelTree one(a), other(b);
        std::int64_t least = 1 << 30;
        for (const Eigen::Vector3i& voxel : a)
        {
            std::int64_t own = 1 << 30;
            for (const Eigen::Vector3i& there : b)
                own = std::min<std::int64_t>(own, (voxel - there).squaredNorm());
            const auto ties =
                std::count_if(b.begin(), b.end(),
                              [&](const Eigen::Vector3i& there)
                              { return (voxel - there).squaredNorm() == own; });
            std::vector<Eigen::Vector3i> found;
            EXPECT_EQ(other.nearest(voxel, 1 << 29, found), own);
            EXPECT_EQ(static_cast<std::ptrdiff_t>(found.size()), ties);
            EXPECT_EQ(other.nearest(voxel, own, found), own);
            EXPECT_EQ(static_cast<std::ptrdiff_t>(found.size()), ties);
            EXPECT_EQ(other.nearest(voxel, own - 1, found), own);
            EXPECT_TRUE(found.empty());
            least = std::min(least, own);
        }
        EXPECT_EQ(one.nearest(other, 1 << 29), least);
        EXPECT_EQ(other.nearest(one, 1 << 29), least);
        EXPECT_EQ(one.nearest(other, least), least);
        EXPECT_LE(one.least_between_boxes(other), least);
    }
}

} // namespace cellwarp::core
