// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/ball_flood.h"

#include <array>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/grids.h"

namespace cellwarp::core
{

using Eigen::Vector3i;
using support::grid_of;

namespace
{

/// Which voxels of a grid no ball of a radius comes to, by a flood for that radius alone
/// in a grid with a border that is wider.
std::vector<char> slow_dry(const VoxelGrid& grid, const VoxelFlags& marks, int radius)
{
    const VoxelRange box{Vector3i::Constant(-radius - 1), grid.counts().array() + radius};
    const Vector3i counts = box.last - box.first + Vector3i::Ones();
    const auto at = [&](const Vector3i& v)
    {
        const Vector3i from = v - box.first;
        return (idx(from.z()) * idx(counts.y()) + idx(from.y())) * idx(counts.x()) +
               idx(from.x());
    };
    std::vector<char> is_dry(idx(counts.prod()), 1), is_closed(is_dry.size(), 0);
    for_each_set(marks,
                 [&](std::size_t mark)
                 {
                     const Vector3i m = grid.coordinates(mark);
                     for_each_voxel(
                         VoxelRange{m.array() - radius, m.array() + radius}.cut(box),
                         [&](const Vector3i& v)
                         {
                             if ((v - m).squaredNorm() <= radius * radius)
                                 is_closed[at(v)] = 1;
                         });
                 });
    std::vector<Vector3i> stack = {box.first};
    is_dry[0] = 0;
    while (!stack.empty())
    {
        const Vector3i v = stack.back();
        stack.pop_back();
        for_each_beside(v,
                        [&](const Vector3i& other)
                        {
                            if (!box.contains(other) || is_closed[at(other)] ||
                                !is_dry[at(other)])
                                return;
                            is_dry[at(other)] = 0;
                            stack.push_back(other);
                        });
    }
    std::vector<char> of_grid(grid.size());
    for (std::size_t i = 0; i < grid.size(); ++i)
        of_grid[i] = is_dry[at(grid.coordinates(i))];
    return of_grid;
}

void expect_as_slow(const VoxelGrid& grid, const VoxelFlags& marks, int most)
{
    const BallFlood flood(grid, marks, most, most + 2);
    // Of each voxel of the lattice the radii at which balls do not come though they fit;
    // of whole blocks how many voxels, by the first such radius.
    std::vector<std::array<int, 2>> missed(flood.lattice().marks().size(), {1, 0});
    std::vector<std::size_t> far_from(idx(most) + 2, 0);
    flood.for_each(
        [&](int reached, int free, std::size_t voxel) {
            missed[voxel] = {reached + 1, free};
        },
        [&](int reached, std::size_t, std::size_t count)
        { far_from[idx(reached + 1)] += count; });
    std::size_t num_far = 0;
    for (int radius = 0; radius <= most; ++radius)
    {
        num_far += far_from[idx(radius)];
        std::size_t num_not_told = 0;
        const std::vector<char> slow = slow_dry(grid, marks, radius);
        const VoxelFlags dry = flood.dry(radius);
        for (std::size_t i = 0; i < grid.size(); ++i)
        {
            const std::size_t place = flood.lattice().at(grid.coordinates(i));
            ASSERT_EQ(dry[place] != 0, slow[i] != 0)
                << radius << ": " << grid.coordinates(i).transpose();
            const bool is_told = missed[place][0] <= radius && radius <= missed[place][1];
            const bool is_missed = slow[i] && flood.distances().is_beyond(place, radius);
            ASSERT_TRUE(is_missed || !is_told) << grid.coordinates(i).transpose();
            num_not_told += is_missed && !is_told;
        }
        // Whole blocks that are missed are enclosed: within the grid.
        ASSERT_EQ(num_not_told, num_far) << radius;
    }
}

} // namespace

TEST(BallFlood, comes_as_far_as_floods_of_each_radius)
{
    std::mt19937 rng(11);
    // Counts beside whole blocks of 8.
    for (const Vector3i& counts : {Vector3i(13, 21, 30), Vector3i(6, 14, 22),
                                   Vector3i(40, 3, 1), Vector3i(24, 24, 24)})
        for (const std::size_t share : {400u, 60u, 12u})
        {
            const VoxelGrid grid = grid_of(counts);
            VoxelFlags marks(grid.size());
            for (std::size_t i = 0; i < grid.size(); ++i)
                marks[i] = rng() % share == 0;
            expect_as_slow(grid, marks, 5);
        }
}

TEST(BallFlood, tells_of_whole_blocks_that_are_enclosed)
{
    // A closed box with a hole of 5 x 5: far from its walls are whole blocks.
    const VoxelGrid grid = grid_of({60, 50, 70});
    VoxelFlags marks(grid.size());
    for_each_voxel({Vector3i::Constant(4), Vector3i(55, 45, 65)},
                   [&](const Vector3i& v)
                   {
                       const bool is_wall = (v.array() == 4).any() || v.x() == 55 ||
                                            v.y() == 45 || v.z() == 65;
                       const bool is_hole = v.z() == 65 && v.x() >= 20 && v.x() < 25 &&
                                            v.y() >= 20 && v.y() < 25;
                       marks[grid.index(v)] = is_wall && !is_hole;
                   });
    std::size_t num_far = 0;
    const BallFlood flood(grid, marks, 5, 7);
    flood.for_each([](int, int, std::size_t) {},
                   [&](int reached, std::size_t first, std::size_t count)
                   {
                       num_far += reached < 5 ? count : 0;
                       EXPECT_TRUE(flood.distances().is_far(first));
                       EXPECT_EQ(flood.dry(5)[first] != 0, reached < 5);
                   });
    EXPECT_GT(num_far, 8u * 8u * 8u);
    expect_as_slow(grid, marks, 5);
}

TEST(BallFlood, finds_the_way_through_a_maze)
{
    // Walls across, each with a gap at the other end: the way winds through all blocks.
    const VoxelGrid grid = grid_of({45, 40, 9});
    VoxelFlags marks(grid.size());
    for (std::size_t i = 0; i < grid.size(); ++i)
    {
        const Vector3i v = grid.coordinates(i);
        const bool is_shell = v.x() == 0 || v.x() == 44 || v.y() == 0 || v.z() == 0 ||
                              v.z() == 8 || (v.y() == 39 && v.x() > 4);
        const bool is_wall = v.x() % 6 == 0 && (v.x() % 12 == 0 ? v.y() > 4 : v.y() < 35);
        marks[i] = is_shell || is_wall;
    }
    expect_as_slow(grid, marks, 4);
}

TEST(BallFlood, of_no_marks_comes_everywhere)
{
    const VoxelGrid grid = grid_of({20, 30, 40});
    const BallFlood flood(grid, VoxelFlags(grid.size()), 9, 9);
    const VoxelFlags dry = flood.dry(9);
    EXPECT_TRUE(dry.is_zero(0, dry.size()));
}

} // namespace cellwarp::core
