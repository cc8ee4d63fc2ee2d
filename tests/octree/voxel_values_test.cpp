// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/voxel_values.h"

#include <algorithm>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

/// Ones at a few places far apart, the last one among them.
VoxelValues<std::uint32_t> scattered(std::size_t size, std::vector<std::size_t>& places)
{
    VoxelValues<std::uint32_t> values(size);
    std::mt19937 rng(7);
    for (std::size_t at = rng() % 100; at < size; at += 1 + rng() % (size / 5))
        places.push_back(at);
    if (places.back() != size - 1)
        places.push_back(size - 1);
    for (const std::size_t at : places)
        values[at] = static_cast<std::uint32_t>(at + 1);
    return values;
}

} // namespace

TEST(VoxelValues, all_are_zero_at_first)
{
    const VoxelValues<float> values(1000);
    EXPECT_EQ(std::accumulate(values.begin(), values.end(), 0.0f), 0.0f);
    EXPECT_TRUE(VoxelValues<float>().empty());
    EXPECT_EQ(VoxelFlags(0).size(), 0u);
}

TEST(VoxelValues, a_copy_has_what_was_written_and_nothing_else)
{
    std::vector<std::size_t> places;
    const VoxelValues<std::uint32_t> values = scattered(100003, places);
    VoxelValues<std::uint32_t> copy = values;
    EXPECT_TRUE(copy == values);
    copy[5000] += 1;
    EXPECT_FALSE(copy == values);
    copy = VoxelValues<std::uint32_t>(values);
    EXPECT_TRUE(copy == values);
    EXPECT_EQ(static_cast<std::size_t>(std::count_if(copy.begin(), copy.end(),
                                                     [](std::uint32_t value)
                                                     { return value != 0; })),
              places.size());
}

TEST(VoxelValues, what_is_set_is_visited_ascending_within_any_limits)
{
    std::vector<std::size_t> places;
    const VoxelValues<std::uint32_t> values = scattered(10007, places);
    std::vector<std::size_t> visited;
    for_each_set(values, [&](std::size_t i) { visited.push_back(i); });
    EXPECT_EQ(visited, places);
    const std::size_t begin = places[1], end = places.back();
    visited.clear();
    for_each_set(values, begin, end, [&](std::size_t i) { visited.push_back(i); });
    EXPECT_EQ(visited, std::vector<std::size_t>(places.begin() + 1, places.end() - 1));
}

TEST(VoxelValues, one_value_at_any_place_is_not_zero)
{
    for (std::size_t size = 1; size < 20; ++size)
        for (std::size_t at = 0; at < size; ++at)
        {
            VoxelFlags flags(size);
            EXPECT_TRUE(flags.is_zero(0, size));
            flags[at] = 0x80;
            EXPECT_FALSE(flags.is_zero(0, size)) << size << " " << at;
            EXPECT_TRUE(flags.is_zero(0, at));
            EXPECT_TRUE(flags.is_zero(at + 1, size));
        }
}

TEST(VoxelNumbers, have_none_until_they_are_set)
{
    VoxelNumbers<std::int32_t> numbers(100);
    VoxelNumbers<std::uint32_t> large(100);
    EXPECT_EQ(numbers[50], -1);
    EXPECT_EQ(large[50], 0xffffffffu);
    numbers.set(50, 0);
    numbers.fill(60, 3, 7);
    numbers.set(61, -1);
    large.set(50, 0xfffffffeu);
    EXPECT_EQ(large[50], 0xfffffffeu);
    std::vector<std::pair<std::size_t, int>> visited;
    numbers.for_each([&](std::size_t voxel, int number)
                     { visited.emplace_back(voxel, number); });
    EXPECT_EQ(visited,
              (std::vector<std::pair<std::size_t, int>>{{50, 0}, {60, 7}, {62, 7}}));
}

} // namespace cellwarp::core
