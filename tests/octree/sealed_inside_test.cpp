// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/sealed_inside.h"

#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/grids.h"

namespace cellwarp::core
{

using Eigen::Vector3i;
using support::grid_of;

namespace
{

double squared(const Vector3i& a)
{
    return a.cast<double>().squaredNorm();
}

/// What marks enclose at one radius, as sealed_inside.cpp says it, without any short cut:
/// on a grid with a border, distances by looking at all marks and at all of the outside.
struct SlowFlood
{
    Vector3i counts;
    int border;
    std::vector<Vector3i> marks;

    SlowFlood(const VoxelGrid& grid, const VoxelFlags& of_grid, int most)
        : counts(grid.counts().array() + 2 * (most + 2)), border(most + 2)
    {
        for (std::size_t i = 0; i < grid.size(); ++i)
            if (of_grid[i])
                marks.push_back(grid.coordinates(i).array() + border);
    }
    std::size_t at(const Vector3i& v) const
    {
        return (idx(v.z()) * idx(counts.y()) + idx(v.y())) * idx(counts.x()) + idx(v.x());
    }
    std::vector<Vector3i> places() const
    {
        std::vector<Vector3i> all;
        for_each_voxel({Vector3i::Zero(), counts.array() - 1},
                       [&](const Vector3i& v) { all.push_back(v); });
        return all;
    }
    std::vector<char> outside(int radius) const
    {
        const VoxelRange all{Vector3i::Zero(), counts.array() - 1};
        std::vector<char> is_closed(idx(counts.prod()), 0), is_out(is_closed.size(), 0);
        for (const Vector3i& mark : marks)
            for_each_voxel(
                VoxelRange{mark.array() - radius, mark.array() + radius}.cut(all),
                [&](const Vector3i& v)
                {
                    if (squared(v - mark) <= radius * radius)
                        is_closed[at(v)] = 1;
                });
        std::vector<Vector3i> stack = {Vector3i::Zero()};
        is_out[0] = 1;
        while (!stack.empty())
        {
            const Vector3i v = stack.back();
            stack.pop_back();
            for (int axis = 0; axis < 3; ++axis)
                for (const int step : {-1, 1})
                {
                    Vector3i next = v;
                    next[axis] += step;
                    if (!all.contains(next) || is_closed[at(next)] || is_out[at(next)])
                        continue;
                    is_out[at(next)] = 1;
                    stack.push_back(next);
                }
        }
        return is_out;
    }
    /// Whether a voxel is farther than \p radius from the outside.
    bool is_inside(const std::vector<char>& is_out, const Vector3i& v, int radius) const
    {
        bool is_deep = true;
        for_each_voxel(VoxelRange{v.array() - radius, v.array() + radius}.cut(
                           {Vector3i::Zero(), counts.array() - 1}),
                       [&](const Vector3i& other)
                       {
                           if (is_out[at(other)] && squared(v - other) <= radius * radius)
                               is_deep = false;
                       });
        return is_deep;
    }
};

/// The surface of a ball with holes: a mark is missing with the given chance.
VoxelFlags holed_ball(const VoxelGrid& grid, const Vector3i& centre, double radius,
                      double missing, unsigned seed)
{
    std::mt19937 rng(seed);
    std::uniform_real_distribution<double> chance(0.0, 1.0);
    VoxelFlags marks(grid.size());
    for (std::size_t i = 0; i < grid.size(); ++i)
        if (std::abs(std::sqrt(squared(grid.coordinates(i) - centre)) - radius) < 0.6 &&
            chance(rng) >= missing)
            marks[i] = 1;
    return marks;
}

bool all(std::size_t)
{
    return true;
}

/// Returns whether anything is enclosed.
bool expect_as_defined(const VoxelGrid& grid, const VoxelFlags& marks, int most)
{
    SealedInside found(grid, marks, most);
    const int radius = found.radius();
    if (radius < 0)
        return false;
    const VoxelFlags is_inside = std::move(found).voxels(all);
    const SlowFlood slow(grid, marks, most);
    const std::vector<char> is_out = slow.outside(radius);
    for (std::size_t i = 0; i < grid.size(); ++i)
    {
        EXPECT_EQ(
            is_inside[i] != 0,
            slow.is_inside(is_out, grid.coordinates(i).array() + slow.border, radius))
            << grid.coordinates(i).transpose();
        if (testing::Test::HasFailure())
            return true;
    }
    return true;
}

} // namespace

TEST(SealedInside, finds_what_the_definition_says)
{
    int num_found = 0;
    for (const double missing : {0.0, 0.1, 0.4, 0.7, 0.9})
        for (const unsigned seed : {1u, 2u})
        {
            const VoxelGrid grid = grid_of(Vector3i::Constant(41));
            const VoxelFlags marks =
                holed_ball(grid, Vector3i(19, 22, 20), 17.0, missing, seed);
            SCOPED_TRACE(testing::Message() << missing << " " << seed);
            num_found += expect_as_defined(grid, marks, 3);
        }
    EXPECT_GE(num_found, 6);
}

TEST(SealedInside, balls_outside_of_the_grid_reach_into_notches)
{
    // A thin hollow plate up to the border of the grid; one of its walls has a hole, and
    // a notch is wider than the plate is thick.
    const VoxelGrid grid = grid_of({37, 30, 11});
    const auto is_in = [&](const Vector3i& v)
    {
        const VoxelRange plate{Vector3i::Zero(), grid.counts().array() - 1},
            notch{{12, 18, 0}, {24, 29, 10}};
        return plate.contains(v) && !notch.contains(v);
    };
    VoxelFlags marks(grid.size());
    for (std::size_t i = 0; i < grid.size(); ++i)
    {
        const Vector3i v = grid.coordinates(i);
        bool is_wall = false;
        for_each_beside(v, [&](const Vector3i& other) { is_wall |= !is_in(other); });
        const bool is_hole = v.z() == 10 && v.x() > 3 && v.x() < 9 && v.y() < 9;
        marks[i] = is_in(v) && is_wall && !is_hole;
    }
    EXPECT_TRUE(expect_as_defined(grid, marks, 4));
}

TEST(SealedInside, takes_the_smallest_radius_that_seals)
{
    const VoxelGrid grid = grid_of(Vector3i::Constant(41));
    for (const int width : {0, 2, 4, 6})
    {
        // A hollow cube with a square hole in one side.
        VoxelFlags marks(grid.size());
        for_each_voxel({Vector3i::Constant(5), Vector3i::Constant(35)},
                       [&](const Vector3i& v)
                       {
                           const bool is_wall =
                               (v.array() == 5).any() || (v.array() == 35).any();
                           const bool is_hole = v.z() == 35 && v.x() >= 18 &&
                                                v.x() < 18 + width && v.y() >= 18 &&
                                                v.y() < 18 + width;
                           marks[grid.index(v)] = is_wall && !is_hole;
                       });
        SealedInside found(grid, marks, 5);
        // The middles of a hole of an even width are width / 2 from the nearest marks.
        EXPECT_EQ(found.radius(), width / 2) << width;
        std::size_t count = 0;
        for_each_set(std::move(found).voxels(all), [&](std::size_t) { ++count; });
        EXPECT_GE(count, 29u * 29u * 29u) << width;
    }
}

TEST(SealedInside, a_few_marks_in_a_large_box_enclose_nothing)
{
    const VoxelGrid grid = grid_of(Vector3i::Constant(200));
    VoxelFlags marks(grid.size());
    marks[grid.index(3, 3, 3)] = marks[grid.index(150, 20, 199)] = 1;
    EXPECT_EQ(SealedInside(grid, marks, 8).radius(), -1);
}

} // namespace cellwarp::core
