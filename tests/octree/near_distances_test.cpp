// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/near_distances.h"

#include <algorithm>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

const Eigen::Vector3i kCounts(13, 7, 9);

std::size_t at(int i, int j, int k)
{
    return idx((k * kCounts.y() + j) * kCounts.x() + i);
}

/// Squared distance to the nearest voxel of the grid that is \p wanted in \p flags.
int slow_squared(const VoxelFlags& flags, bool wanted, int i, int j, int k)
{
    int nearest = std::numeric_limits<int>::max();
    for (int c = 0; c < kCounts.z(); ++c)
        for (int b = 0; b < kCounts.y(); ++b)
            for (int a = 0; a < kCounts.x(); ++a)
                if ((flags[at(a, b, c)] != 0) == wanted)
                    nearest = std::min(nearest, (a - i) * (a - i) + (b - j) * (b - j) +
                                                    (c - k) * (c - k));
    return nearest;
}

template <class Visit>
void for_all(Visit&& visit)
{
    for (int k = 0; k < kCounts.z(); ++k)
        for (int j = 0; j < kCounts.y(); ++j)
            for (int i = 0; i < kCounts.x(); ++i)
                visit(i, j, k);
}

} // namespace

TEST(NearDistances, are_those_of_the_nearest_marks_up_to_the_reach)
{
    std::mt19937 rng(5);
    for (const double reach : {1.0, 1.5, 3.0, 4.2, 20.0})
    {
        VoxelFlags marks(idx(kCounts.prod()));
        for (int n = 0; n < 5; ++n)
            marks[rng() % marks.size()] = 1;
        const NearDistances distances(marks, kCounts, reach);
        for_all(
            [&](int i, int j, int k)
            {
                const int wanted = slow_squared(marks, true, i, j, k);
                const std::size_t voxel = at(i, j, k);
                ASSERT_EQ(distances.is_far(voxel), wanted > reach * reach) << reach;
                if (wanted <= reach * reach)
                {
                    ASSERT_EQ(distances.squared(voxel), static_cast<unsigned>(wanted));
                }
                ASSERT_EQ(distances.is_beyond(voxel, 1.0), wanted > 1);
            });
    }
    const NearDistances none(VoxelFlags(8), {2, 2, 2}, 9.0);
    for (std::size_t line = 0; line < 4; ++line)
        EXPECT_TRUE(none.are_far(line, 0, 2));
}

TEST(NearDistances, are_told_up_to_the_farthest_along_every_axis)
{
    // Lines longer than every reach, and one so long that squares of it are no int.
    for (const Eigen::Vector3i& counts :
         {Eigen::Vector3i(400, 1, 1), Eigen::Vector3i(1, 400, 1),
          Eigen::Vector3i(1, 1, 400), Eigen::Vector3i(33, 2, 400),
          Eigen::Vector3i(50000, 1, 1)})
        for (const double reach : {179.9, 180.0, 500.0})
        {
            VoxelFlags marks(idx(counts.prod()));
            marks[marks.size() - 1] = 1;
            const NearDistances distances(marks, counts, reach);
            const double most = std::min(reach, NearDistances::kFarthest);
            for (int i = 0; i < counts.prod(); ++i)
            {
                const Eigen::Vector3i at(i % counts.x(), i / counts.x() % counts.y(),
                                         i / counts.x() / counts.y());
                const double squared =
                    (counts - Eigen::Vector3i::Ones() - at).cast<double>().squaredNorm();
                ASSERT_EQ(distances.is_far(idx(i)), squared > most * most)
                    << counts.transpose() << ": " << i;
                if (squared <= most * most)
                {
                    ASSERT_EQ(distances.squared(idx(i)), squared);
                }
            }
        }
}

TEST(NearDistances, what_is_near_in_a_line_is_visited)
{
    // Lines of more than one group.
    const Eigen::Vector3i counts(75, 6, 5);
    VoxelFlags marks(idx(counts.prod()));
    marks[(2 * 6 + 3) * 75 + 33] = marks[(1 * 6 + 1) * 75 + 74] = 1;
    const NearDistances distances(marks, counts, 3.0);
    for (std::size_t line = 0; line < 30; ++line)
    {
        std::vector<std::size_t> near, visited;
        for (std::size_t x = 0; x < 75; ++x)
            if (!distances.is_far(line * 75 + x))
                near.push_back(x);
        distances.for_each_near(line, [&](std::size_t x) { visited.push_back(x); });
        EXPECT_EQ(visited, near);
        for (std::size_t x = 0; x < 75; ++x)
            EXPECT_EQ(distances.are_far(line, x, 1), distances.is_far(line * 75 + x));
    }
}

TEST(Shrink, keeps_what_is_deeper_than_the_reach)
{
    std::mt19937 rng(6);
    for (const int reach : {0, 1, 2, 3})
    {
        VoxelFlags set(idx(kCounts.prod()));
        for (std::size_t i = 0; i < set.size(); ++i)
            set[i] = rng() % 40 != 0;
        VoxelFlags shrunk = set;
        shrink(shrunk, kCounts, reach);
        for_all(
            [&](int i, int j, int k)
            {
                ASSERT_EQ(shrunk[at(i, j, k)] != 0,
                          slow_squared(set, false, i, j, k) > reach * reach)
                    << reach;
            });
    }
    VoxelFlags all(8);
    for (std::size_t i = 0; i < all.size(); ++i)
        all[i] = 1;
    shrink(all, {2, 2, 2}, 5);
    EXPECT_TRUE(all[0] && all[7]);
}

} // namespace cellwarp::core
