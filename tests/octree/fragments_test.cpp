// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/fragments.h"

#include <cstdlib>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/grids.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3i;
using support::grid_of;

void fill(VoxelGrid& grid, const Vector3i& first, const Vector3i& last)
{
    for_each_voxel({first, last},
                   [&](const Vector3i& v) { grid.material()[grid.index(v)] = 1; });
}

std::size_t count(const VoxelGrid& grid)
{
    std::size_t sum = 0;
    for_each_set(grid.material(), [&](std::size_t) { ++sum; });
    return sum;
}

} // namespace

TEST(Fragments, specks_are_joined_by_the_shortest_way_up_to_the_reach)
{
    // Above a slab, far from each other; and as much of them again as the slab has, for
    // which all is looked at in one go.
    for (const bool are_many : {false, true})
    {
        SCOPED_TRACE(are_many);
        const std::vector<int> gaps = {1, 2, 3, 6, 7, 15, 30, 31, 39, 45, 60};
        VoxelGrid grid = grid_of({100 * int(gaps.size()), 120, 170});
        fill(grid, {0, 0, 0}, {100 * int(gaps.size()) - 1, 119, 9});
        for (std::size_t k = 0; k < gaps.size(); ++k)
            grid.material()[grid.index({100 * int(k) + 50, 60, 10 + gaps[k]})] = 1;
        if (are_many)
            fill(grid, {0, 0, 155}, {100 * int(gaps.size()) - 1, 119, 160});
        const std::size_t before = count(grid);
        join_fragments(grid, 40);
        std::size_t added = 0;
        for (std::size_t k = 0; k < gaps.size(); ++k)
        {
            SCOPED_TRACE(gaps[k]);
            const bool is_joined = gaps[k] <= 40;
            for (int z = 10; z < 10 + gaps[k]; ++z)
                EXPECT_EQ(grid.material()[grid.index({100 * int(k) + 50, 60, z})],
                          is_joined);
            added += is_joined ? std::size_t(gaps[k]) : 0;
        }
        EXPECT_EQ(count(grid), before + added);
    }
}

TEST(Fragments, specks_are_joined_to_each_other_where_that_is_shorter)
{
    VoxelGrid grid = grid_of({200, 60, 60});
    fill(grid, {0, 0, 0}, {199, 59, 4});
    for (const int x : {50, 56, 62})
        grid.material()[grid.index({x, 30, 35})] = 1;
    const std::size_t before = count(grid);
    join_fragments(grid, 60);
    EXPECT_EQ(count(grid), before + 30 + 5 + 5); // one way down, two aside
    for (int x = 50; x <= 62; ++x)
        EXPECT_TRUE(grid.material()[grid.index({x, 30, 35})]) << x;
}

TEST(Fragments, what_hangs_together_stays_as_it_is)
{
    VoxelGrid grid = grid_of({40, 40, 40});
    join_fragments(grid, 10);
    EXPECT_EQ(count(grid), 0u);
    fill(grid, {3, 3, 3}, {20, 20, 20});
    const VoxelFlags before = grid.material();
    join_fragments(grid, 10);
    EXPECT_EQ(grid.material(), before);
}

} // namespace cellwarp::core
