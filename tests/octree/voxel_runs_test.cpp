// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/voxel_runs.h"

#include <random>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

std::vector<std::size_t> list_of(const VoxelRuns& runs)
{
    std::vector<std::size_t> list;
    runs.for_each([&](std::size_t voxel) { list.push_back(voxel); });
    return list;
}

std::vector<std::size_t> list_of(const std::set<std::size_t>& voxels)
{
    return {voxels.begin(), voxels.end()};
}

} // namespace

TEST(VoxelRuns, of_any_order_and_overlap_are_the_set_of_their_voxels)
{
    std::mt19937 rng(5);
    for (int trial = 0; trial < 200; ++trial)
    {
        std::set<std::size_t> wanted;
        std::vector<VoxelRuns::Run> runs;
        for (std::size_t k = rng() % 12; k > 0; --k)
        {
            const auto begin = static_cast<std::uint32_t>(rng() % 60);
            const auto end = static_cast<std::uint32_t>(begin + rng() % 10);
            runs.push_back({begin, end});
            for (std::size_t voxel = begin; voxel < end; ++voxel)
                wanted.insert(voxel);
        }
        const VoxelRuns set(runs);
        EXPECT_EQ(list_of(set), list_of(wanted));
        EXPECT_EQ(set.num_voxels(), wanted.size());
        EXPECT_EQ(set.empty(), wanted.empty());
        for (std::size_t k = 0; k + 1 < set.runs().size(); ++k)
            EXPECT_LT(set.runs()[k].end, set.runs()[k + 1].begin);
        for (std::size_t voxel = 0; voxel < 75; ++voxel)
            EXPECT_EQ(set.has(voxel), wanted.count(voxel) > 0) << voxel;
    }
}

TEST(VoxelRuns, added_one_after_the_other_join_where_they_touch)
{
    VoxelRuns runs;
    EXPECT_TRUE(runs.empty());
    runs.add(3);
    runs.add(4, 4); // nothing
    runs.add(4, 7);
    runs.add(9);
    EXPECT_EQ(runs.runs().size(), 2u);
    EXPECT_EQ(list_of(runs), (std::vector<std::size_t>{3, 4, 5, 6, 9}));
}

TEST(VoxelRuns, parts_of_a_range_are_cut_at_its_ends)
{
    VoxelRuns runs;
    runs.add(2, 6);
    runs.add(8, 10);
    runs.add(12, 20);
    using Parts = std::vector<std::pair<std::size_t, std::size_t>>;
    const auto parts_of = [&](std::size_t begin, std::size_t end)
    {
        Parts parts;
        runs.for_each_part(begin, end,
                           [&](std::size_t from, std::size_t to)
                           { parts.emplace_back(from, to); });
        return parts;
    };
    EXPECT_EQ(parts_of(0, 30), (Parts{{2, 6}, {8, 10}, {12, 20}}));
    EXPECT_EQ(parts_of(4, 13), (Parts{{4, 6}, {8, 10}, {12, 13}}));
    EXPECT_EQ(parts_of(6, 8), Parts{});
    EXPECT_EQ(parts_of(13, 15), (Parts{{13, 15}}));
    EXPECT_EQ(parts_of(20, 30), Parts{});
}

TEST(VoxelRuns, united_hold_what_is_in_either)
{
    VoxelRuns a, b;
    a.add(1, 3);
    a.add(10, 12);
    b.add(3, 5);
    b.add(11, 14);
    EXPECT_EQ(list_of(united(a, b)),
              (std::vector<std::size_t>{1, 2, 3, 4, 10, 11, 12, 13}));
    EXPECT_EQ(list_of(united(a, {})), list_of(a));
}

} // namespace cellwarp::core
