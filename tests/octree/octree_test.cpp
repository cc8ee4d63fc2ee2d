// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/octree.h"

#include <numeric>
#include <random>

#include <gtest/gtest.h>

namespace cellwarp
{

namespace
{

constexpr int kDepth = 4;

GridShape shape()
{
    return grid_shape({2, 1, 1}, 4, kDepth, 0.0);
}

const MaterialTest kAll = [](const Leaf&) { return true; };

/// Volume of the leaves in finest boxes.
std::int64_t volume(const Octree& octree)
{
    std::int64_t sum = 0;
    for (const Leaf& leaf : octree.leaves())
        sum += std::int64_t(octree.width(leaf)) * octree.width(leaf) * octree.width(leaf);
    return sum;
}

Octree randomly_split(unsigned seed, int rounds)
{
    std::mt19937 rng(seed);
    Octree octree(shape(), kAll);
    for (int round = 0; round < rounds; ++round)
    {
        const int leaf = static_cast<int>(rng() % octree.leaves().size());
        octree = octree.split(std::vector<int>{leaf}, kAll);
    }
    return octree;
}

} // namespace

TEST(Octree, starts_as_the_coarsest_grid)
{
    const Octree octree(shape(), kAll);
    EXPECT_EQ(octree.leaves().size(), 16u);
    EXPECT_TRUE(octree.is_balanced());
}

TEST(Octree, boxes_without_material_are_left_out)
{
    const MaterialTest left = [](const Leaf& leaf) { return leaf.corner.x() < 16; };
    const Octree octree = Octree(shape(), left).split_all(1, left);
    EXPECT_EQ(octree.leaves().size(), 4u * 8u);
    EXPECT_EQ(octree.find({16, 0, 0}), -1);
    EXPECT_GE(octree.find({15, 0, 0}), 0);
}

TEST(Octree, every_place_is_found_in_its_leaf)
{
    const Octree octree = randomly_split(1, 40);
    std::mt19937 rng(2);
    for (int trial = 0; trial < 1000; ++trial)
    {
        const Eigen::Vector3i place(static_cast<int>(rng() % 64),
                                    static_cast<int>(rng() % 32),
                                    static_cast<int>(rng() % 32));
        const int found = octree.find(place);
        ASSERT_GE(found, 0);
        const Leaf& leaf = octree.leaves()[static_cast<std::size_t>(found)];
        EXPECT_TRUE((place.array() >= leaf.corner.array()).all());
        EXPECT_TRUE((place.array() < leaf.corner.array() + octree.width(leaf)).all());
    }
    EXPECT_EQ(octree.find({-1, 0, 0}), -1);
    EXPECT_EQ(octree.find({64, 0, 0}), -1);
}

TEST(Octree, splitting_keeps_the_volume_and_the_balance)
{
    for (unsigned seed = 0; seed < 5; ++seed)
    {
        const Octree octree = randomly_split(seed, 60);
        EXPECT_EQ(volume(octree), 64 * 32 * 32);
        EXPECT_TRUE(octree.is_balanced());
    }
}

TEST(Octree, a_deep_corner_makes_its_neighbours_follow)
{
    Octree octree(shape(), kAll);
    for (int depth = 0; depth < kDepth; ++depth)
        octree = octree.split(std::vector<int>{octree.find({15, 15, 15})}, kAll);
    EXPECT_EQ(octree.leaves()[static_cast<std::size_t>(octree.find({15, 15, 15}))].level,
              kDepth);
    EXPECT_GE(octree.leaves()[static_cast<std::size_t>(octree.find({16, 15, 15}))].level,
              kDepth - 1);
    EXPECT_TRUE(octree.is_balanced());
}

TEST(Octree, leaves_at_the_deepest_level_stay)
{
    const Octree octree =
        Octree(grid_shape({1, 1, 1}, 2, 1, 0.0), kAll).split_all(1, kAll);
    std::vector<int> all(octree.leaves().size());
    std::iota(all.begin(), all.end(), 0);
    EXPECT_EQ(octree.split(all, kAll).leaves(), octree.leaves());
}

TEST(Octree, merging_undoes_splitting)
{
    const Octree coarse(shape(), kAll);
    Octree octree = coarse.split(std::vector<int>{3, 7}, kAll);
    EXPECT_EQ(octree.leaves().size(), 16u + 14u);
    std::vector<int> all(octree.leaves().size());
    std::iota(all.begin(), all.end(), 0);
    EXPECT_EQ(octree.merge(all).leaves(), coarse.leaves());
}

TEST(Octree, merging_never_breaks_the_balance)
{
    for (unsigned seed = 10; seed < 15; ++seed)
    {
        const Octree octree = randomly_split(seed, 60);
        std::mt19937 rng(seed);
        std::vector<int> some;
        for (std::size_t i = 0; i < octree.leaves().size(); ++i)
            if (rng() % 2)
                some.push_back(static_cast<int>(i));
        const Octree merged = octree.merge(some);
        EXPECT_LT(merged.leaves().size(), octree.leaves().size());
        EXPECT_TRUE(merged.is_balanced());
        EXPECT_EQ(volume(merged), volume(octree));
    }
}

TEST(Octree, keys_stay_exact_at_twenty_levels)
{
    const GridShape deep = grid_shape({1, 1, 1}, 2, 20, 0.0);
    Octree octree(deep, [](const Leaf& leaf) { return leaf.corner.isZero(); });
    for (int depth = 0; depth < 20; ++depth)
        octree = octree.split(std::vector<int>{octree.find({0, 0, 0})},
                              [](const Leaf& leaf) { return leaf.corner.isZero(); });
    ASSERT_EQ(octree.leaves().size(), 1u);
    EXPECT_EQ(octree.leaves()[0].level, 20);
    EXPECT_EQ(octree.find({1, 0, 0}), -1);
}

} // namespace cellwarp
