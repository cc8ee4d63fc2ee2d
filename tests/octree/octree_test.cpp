// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/octree.h"

#include <random>
#include <utility>

#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace cellwarp::core
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
        const LeafNumber leaf{static_cast<int>(rng() % octree.leaves().size())};
        octree = octree.split(std::vector{leaf}, kAll);
    }
    return octree;
}

std::vector<LeafNumber> all_of(const Octree& octree)
{
    std::vector<LeafNumber> all;
    for (const LeafNumber leaf : octree.numbers())
        all.push_back(leaf);
    return all;
}

bool overlap(const Leaf& leaf, const Leaf& box)
{
    const int a = 1 << (kDepth - leaf.level), b = 1 << (kDepth - box.level);
    return (leaf.corner.array() < box.corner.array() + b).all() &&
           (box.corner.array() < leaf.corner.array() + a).all();
}

/// Material is a third of the finest boxes, by a seeded draw.
MaterialTest speckled(unsigned seed)
{
    std::mt19937 rng(seed);
    std::vector<bool> holds(64 * 32 * 32);
    for (std::size_t i = 0; i < holds.size(); ++i)
        holds[i] = rng() % 3 == 0;
    return [holds](const Leaf& leaf)
    {
        const int w = 1 << (kDepth - leaf.level);
        for (int k = 0; k < w; ++k)
            for (int j = 0; j < w; ++j)
                for (int i = 0; i < w; ++i)
                {
                    const Eigen::Vector3i at = leaf.corner + Eigen::Vector3i(i, j, k);
                    if (holds[idx((at.z() * 32 + at.y()) * 64 + at.x())])
                        return true;
                }
        return false;
    };
}

/// What siblings() promises, by looking at every pair of leaves.
std::vector<std::vector<LeafNumber>> families_one_by_one(const Octree& octree)
{
    std::vector<std::vector<LeafNumber>> families;
    for (const LeafNumber i : octree.numbers())
    {
        const Leaf& one = octree[i];
        if (one.level == 0)
            continue;
        const int w = 2 * octree.width(one);
        const Leaf box{one.corner / w * w, one.level - 1};
        std::vector<LeafNumber> family;
        bool is_whole = true;
        for (const LeafNumber j : octree.numbers())
            if (overlap(octree[j], box))
            {
                family.push_back(j);
                is_whole &= octree[j].level == one.level;
            }
        if (is_whole && family.front() == i)
            families.push_back(family);
    }
    return families;
}

/// Merges what lies below the leaves of \p goal for as long as that changes anything.
Octree merged_down_to(const Octree& goal, Octree octree)
{
    for (;;)
    {
        std::vector<LeafNumber> finer;
        for (const LeafNumber leaf : octree.numbers())
        {
            const LeafNumber base = goal.find(octree[leaf].corner);
            if (goal[base].level < octree[leaf].level)
                finer.push_back(leaf);
        }
        Octree next = octree.merge(finer);
        if (next.leaves().size() == octree.leaves().size())
            return octree;
        octree = std::move(next);
    }
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
    EXPECT_EQ(octree.find({16, 0, 0}), LeafNumber::None);
    EXPECT_NE(octree.find({15, 0, 0}), LeafNumber::None);
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
        const LeafNumber found = octree.find(place);
        ASSERT_NE(found, LeafNumber::None);
        const Leaf& leaf = octree[found];
        EXPECT_TRUE((place.array() >= leaf.corner.array()).all());
        EXPECT_TRUE((place.array() < leaf.corner.array() + octree.width(leaf)).all());
    }
    EXPECT_EQ(octree.find({-1, 0, 0}), LeafNumber::None);
    EXPECT_EQ(octree.find({64, 0, 0}), LeafNumber::None);
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
        octree = octree.split(std::vector{octree.find({15, 15, 15})}, kAll);
    EXPECT_EQ(octree[octree.find({15, 15, 15})].level, kDepth);
    EXPECT_GE(octree[octree.find({16, 15, 15})].level, kDepth - 1);
    EXPECT_TRUE(octree.is_balanced());
}

TEST(Octree, leaves_at_the_deepest_level_stay)
{
    const Octree octree =
        Octree(grid_shape({1, 1, 1}, 2, 1, 0.0), kAll).split_all(1, kAll);
    EXPECT_EQ(octree.split(all_of(octree), kAll).leaves(), octree.leaves());
}

TEST(Octree, leaves_are_known_by_their_numbers_in_another_octree)
{
    const Octree before = randomly_split(5, 20), after = randomly_split(6, 30);
    for (const auto& [one, other] : {std::pair(&before, &after), {&after, &before}})
    {
        const std::vector<LeafNumber> numbers = one->numbers_in(*other);
        ASSERT_EQ(numbers.size(), one->leaves().size());
        int num_known = 0;
        for (const LeafNumber leaf : one->numbers())
        {
            LeafNumber wanted = LeafNumber::None;
            for (const LeafNumber candidate : other->numbers())
                if ((*other)[candidate] == (*one)[leaf])
                    wanted = candidate;
            EXPECT_EQ(numbers[idx(leaf)], wanted);
            num_known += wanted != LeafNumber::None;
        }
        EXPECT_GT(num_known, 0);
        EXPECT_LT(num_known, static_cast<int>(numbers.size()));
    }
}

TEST(Octree, merging_undoes_splitting)
{
    const Octree coarse(shape(), kAll);
    Octree octree = coarse.split(std::vector{LeafNumber{3}, LeafNumber{7}}, kAll);
    EXPECT_EQ(octree.leaves().size(), 16u + 14u);
    EXPECT_EQ(octree.merge(all_of(octree)).leaves(), coarse.leaves());
}

TEST(Octree, merging_never_breaks_the_balance)
{
    for (unsigned seed = 10; seed < 15; ++seed)
    {
        const Octree octree = randomly_split(seed, 60);
        std::mt19937 rng(seed);
        std::vector<LeafNumber> some;
        for (std::size_t i = 0; i < octree.leaves().size(); ++i)
            if (rng() % 2)
                some.push_back(LeafNumber(i));
        const Octree merged = octree.merge(some);
        EXPECT_LT(merged.leaves().size(), octree.leaves().size());
        EXPECT_TRUE(merged.is_balanced());
        EXPECT_EQ(volume(merged), volume(octree));
    }
}

TEST(Octree, merging_many_boxes_at_once_keeps_the_volume_and_the_balance)
{
    for (unsigned seed = 20; seed < 30; ++seed)
    {
        SCOPED_TRACE(seed);
        Octree octree = randomly_split(seed, 150);
        for (int round = 0; round < kDepth; ++round)
        {
            const Octree merged = octree.merge(all_of(octree));
            EXPECT_LT(merged.leaves().size(), octree.leaves().size());
            EXPECT_TRUE(merged.is_balanced());
            EXPECT_EQ(volume(merged), 64 * 32 * 32);
            for (std::size_t i = 0; i + 1 < merged.leaves().size(); ++i)
                ASSERT_FALSE(overlap(merged.leaves()[i], merged.leaves()[i + 1]));
            octree = merged;
            if (octree.leaves().size() == 16u)
                break;
        }
        EXPECT_EQ(octree.leaves(), Octree(shape(), kAll).leaves());
    }
}

TEST(Octree, merging_what_balance_split_too_gives_the_same_octree_back)
{
    for (unsigned seed = 30; seed < 40; ++seed)
    {
        SCOPED_TRACE(seed);
        const Octree before = randomly_split(seed, 40);
        std::mt19937 rng(seed);
        std::vector<LeafNumber> some;
        for (std::size_t i = 0; i < before.leaves().size(); ++i)
            if (rng() % 8 == 0)
                some.push_back(LeafNumber(i));
        const Octree finer = before.split(some, kAll);
        EXPECT_GT(finer.leaves().size(), before.leaves().size());
        EXPECT_EQ(merged_down_to(before, finer).leaves(), before.leaves());
    }
}

TEST(Octree, all_merged_has_boxes_above_the_coarsest_grid)
{
    const Octree coarse(shape(), kAll); // 4 x 2 x 2
    EXPECT_EQ(coarse.split_all(1, kAll).merge_all().leaves(), coarse.leaves());
    const Octree larger = coarse.merge_all();
    ASSERT_EQ(larger.leaves().size(), 2u);
    EXPECT_EQ(larger.leaves()[0].level, -1);
    EXPECT_EQ(larger.width(larger.leaves()[0]), 32);
    EXPECT_EQ(volume(larger), 64 * 32 * 32);
    // A box of twice that size would stand out of the grid.
    EXPECT_EQ(larger.merge_all().leaves(), larger.leaves());
    EXPECT_EQ(larger.split(all_of(larger), kAll).leaves(), coarse.leaves());
}

TEST(Octree, all_merged_again_and_again_keeps_the_volume_and_the_balance)
{
    for (unsigned seed = 40; seed < 50; ++seed)
    {
        SCOPED_TRACE(seed);
        Octree octree = randomly_split(seed, 150);
        for (std::size_t before = 0; octree.leaves().size() != before;)
        {
            before = octree.leaves().size();
            octree = octree.merge_all();
            EXPECT_TRUE(octree.is_balanced());
            EXPECT_EQ(volume(octree), 64 * 32 * 32);
        }
        EXPECT_EQ(octree.leaves().size(), 2u);
    }
}

TEST(Octree, where_the_grid_has_an_odd_number_of_boxes_the_last_ones_stay)
{
    GridShape odd = shape();
    odd.coarsest = {5, 3, 1};
    const Octree larger = Octree(odd, kAll).merge_all();
    EXPECT_EQ(larger.leaves(), Octree(odd, kAll).leaves()); // one layer has no parents
    odd.coarsest = {5, 3, 2};
    EXPECT_EQ(Octree(odd, kAll).merge_all().leaves().size(), 2u + 30u - 16u);
    EXPECT_TRUE(Octree(odd, kAll).merge_all().merge_all().is_balanced());
}

TEST(Octree, families_are_whole_and_ascending)
{
    const Octree coarse(shape(), kAll);
    EXPECT_TRUE(coarse.siblings().empty());
    const Octree octree = coarse.split(std::vector{LeafNumber{3}}, kAll);
    const std::vector<std::vector<LeafNumber>> families = octree.siblings();
    ASSERT_EQ(families.size(), 1u);
    EXPECT_EQ(families[0],
              (std::vector{LeafNumber{3}, LeafNumber{4}, LeafNumber{5}, LeafNumber{6},
                           LeafNumber{7}, LeafNumber{8}, LeafNumber{9}, LeafNumber{10}}));
    for (const LeafNumber leaf : families[0])
        EXPECT_TRUE(overlap(octree.leaves()[idx(leaf)], coarse.leaves()[3]));
}

TEST(Octree, a_family_of_which_one_part_is_split_is_none)
{
    Octree octree(shape(), kAll);
    for (int depth = 0; depth < 2; ++depth)
        octree = octree.split(std::vector{octree.find({0, 0, 0})}, kAll);
    const std::vector<std::vector<LeafNumber>> families = octree.siblings();
    ASSERT_EQ(families.size(), 1u);
    EXPECT_EQ(families[0],
              (std::vector{LeafNumber{0}, LeafNumber{1}, LeafNumber{2}, LeafNumber{3},
                           LeafNumber{4}, LeafNumber{5}, LeafNumber{6}, LeafNumber{7}}));
    EXPECT_EQ(octree.leaves()[0].level, 2);
    EXPECT_EQ(octree.leaves()[8].level, 1);
    // The last part split leaves seven in front of it.
    octree = Octree(shape(), kAll).split(std::vector{LeafNumber{0}}, kAll);
    octree = octree.split(std::vector{LeafNumber{7}}, kAll);
    for (const std::vector<LeafNumber>& family : octree.siblings())
        EXPECT_NE(family.front(), LeafNumber{0});
}

TEST(Octree, a_family_at_the_border_has_the_parts_that_hold_material)
{
    for (const int first : {0, 8})
    {
        SCOPED_TRACE(first);
        const MaterialTest slab = [&](const Leaf& leaf)
        {
            return leaf.corner.x() < first + 8 &&
                   leaf.corner.x() + (1 << (kDepth - leaf.level)) > first;
        };
        const Octree coarse(shape(), slab);
        ASSERT_EQ(coarse.leaves().size(), 4u);
        const Octree octree = coarse.split(std::vector{LeafNumber{1}}, slab);
        const std::vector<std::vector<LeafNumber>> families = octree.siblings();
        ASSERT_EQ(families.size(), 1u);
        EXPECT_EQ(families[0], (std::vector{LeafNumber{1}, LeafNumber{2}, LeafNumber{3},
                                            LeafNumber{4}}));
        EXPECT_EQ(octree.merge(families[0]).leaves(), coarse.leaves());
    }
}

TEST(Octree, families_of_speckled_material_are_those_found_one_by_one)
{
    for (unsigned seed = 40; seed < 45; ++seed)
    {
        SCOPED_TRACE(seed);
        const MaterialTest speckles = speckled(seed);
        std::mt19937 rng(seed);
        Octree octree(shape(), speckles);
        for (int round = 0; round < 40; ++round)
            octree = octree.split(std::vector{LeafNumber(rng() % octree.leaves().size())},
                                  speckles);
        const std::vector<std::vector<LeafNumber>> families = octree.siblings();
        EXPECT_GT(families.size(), 10u);
        EXPECT_EQ(families, families_one_by_one(octree));
    }
}

TEST(Octree, a_hundred_thousand_leaves_are_split_and_merged_looking_at_each_part_once)
{
    std::size_t num_looks = 0;
    const MaterialTest counted = [&](const Leaf&)
    {
        ++num_looks;
        return true;
    };
    const Octree coarse(grid_shape({1, 1, 1}, 6, 3, 0.0), counted);
    const Octree fine = coarse.split_all(3, counted);
    ASSERT_EQ(fine.leaves().size(), 216u * 512u);
    EXPECT_EQ(num_looks, 216u * (1u + 8u + 64u + 512u));
    Octree merged = fine;
    for (int level = 2; level >= 0; --level)
    {
        EXPECT_EQ(merged.siblings().size(), 216u << 3 * level);
        merged = merged.merge(all_of(merged));
        EXPECT_EQ(merged.leaves().size(), 216u << 3 * level);
    }
    EXPECT_EQ(merged.leaves(), coarse.leaves());
    EXPECT_EQ(num_looks, 216u * (1u + 8u + 64u + 512u));
}

TEST(Octree, keys_stay_exact_at_twenty_levels)
{
    const GridShape deep = grid_shape({1, 1, 1}, 2, 20, 0.0);
    Octree octree(deep, [](const Leaf& leaf) { return leaf.corner.isZero(); });
    for (int depth = 0; depth < 20; ++depth)
        octree = octree.split(std::vector{octree.find({0, 0, 0})},
                              [](const Leaf& leaf) { return leaf.corner.isZero(); });
    ASSERT_EQ(octree.leaves().size(), 1u);
    EXPECT_EQ(octree.leaves()[0].level, 20);
    EXPECT_EQ(octree.find({1, 0, 0}), LeafNumber::None);
}

} // namespace cellwarp::core
