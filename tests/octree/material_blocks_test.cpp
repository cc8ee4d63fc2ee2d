// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/material_blocks.h"

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "octree/hold_together.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3i;

/// A grid whose sides are no whole numbers of blocks, with materials at random, and
/// notches between them.
struct RandomMaterial
{
    VoxelGrid grid;
    Notches notches;

    RandomMaterial(unsigned seed, int num_materials, double share, double open)
        : grid(grid_shape({9, 6, 7}, 9, 0, 0.5))
    {
        std::mt19937 rng(seed);
        std::uniform_real_distribution<double> number(0.0, 1.0);
        std::uniform_int_distribution<int> material(1, num_materials);
        VoxelFlags open_sides(grid.size());
        for (std::size_t v = 0; v < grid.size(); ++v)
        {
            if (number(rng) < share)
                grid.material()[v] = static_cast<std::uint8_t>(material(rng));
            for (int axis = 0; axis < 3; ++axis)
                if (number(rng) < open)
                    open_sides[v] |= static_cast<std::uint8_t>(1 << axis);
        }
        if (open > 0.0)
            notches = Notches(grid, std::move(open_sides));
    }

    template <class Visit>
    void for_each_held_pair(Visit&& visit) const
    {
        for (std::size_t v = 0; v < grid.size(); ++v)
            for (int axis = 0; axis < 3; ++axis)
            {
                const Vector3i at = grid.coordinates(v);
                const Vector3i next = at + Vector3i::Unit(axis);
                if (grid.material()[v] && grid.contains(next) &&
                    hold_together(grid, notches, at, next))
                    visit(at, next);
            }
    }
};

void expect_blocks(const RandomMaterial& of)
{
    const MaterialBlocks blocks(of.grid, of.notches);
    const auto in_block = [](const Vector3i& v) -> Vector3i
    { return v / MaterialBlocks::kWidth; };
    // Each voxel of material is in one part, of its block.
    std::map<std::size_t, std::size_t> part_of;
    for (std::size_t part = 0; part < blocks.size(); ++part)
    {
        EXPECT_NE(blocks.voxels(part), 0u);
        for_each_bit(blocks.voxels(part),
                     [&](int bit)
                     {
                         const Vector3i at =
                             blocks.first_voxel(blocks.block(part)) + place_of_bit(bit);
                         ASSERT_TRUE(of.grid.contains(at));
                         EXPECT_EQ(bit_of_place(place_of_bit(bit)), bit);
                         EXPECT_EQ(blocks.part_of(at), part);
                         EXPECT_TRUE(part_of.emplace(of.grid.index(at), part).second);
                     });
    }
    std::size_t count = 0;
    for_each_set(of.grid.material(), [&](std::size_t) { ++count; });
    EXPECT_EQ(part_of.size(), count);
    // Parts are what a way within the block joins, and linked where a way leads on.
    std::map<std::size_t, std::size_t> root;
    const auto root_of = [&](std::size_t v)
    {
        while (root.contains(v))
            v = root.at(v);
        return v;
    };
    std::set<std::pair<std::size_t, std::size_t>> links;
    of.for_each_held_pair(
        [&](const Vector3i& a, const Vector3i& b)
        {
            const std::size_t at_a = of.grid.index(a), at_b = of.grid.index(b);
            if (in_block(a) != in_block(b))
            {
                links.emplace(part_of.at(at_a), part_of.at(at_b));
                links.emplace(part_of.at(at_b), part_of.at(at_a));
            }
            else if (root_of(at_a) != root_of(at_b))
                root.emplace(root_of(at_a), root_of(at_b));
        });
    std::map<std::size_t, std::size_t> part_of_root;
    for (const auto& [voxel, part] : part_of)
        EXPECT_EQ(part_of_root.try_emplace(root_of(voxel), part).first->second, part);
    EXPECT_EQ(part_of_root.size(), blocks.size());
    std::set<std::pair<std::size_t, std::size_t>> found;
    for (std::size_t part = 0; part < blocks.size(); ++part)
        blocks.for_each_linked(part, [&](std::size_t other)
                               { EXPECT_TRUE(found.emplace(part, other).second); });
    EXPECT_EQ(found, links);
}

} // namespace

TEST(MaterialBlocks, hold_what_is_connected_inside_them_and_know_what_goes_on)
{
    for (unsigned seed = 1; seed <= 2; ++seed)
        for (const double share : {0.3, 0.6, 0.95, 1.0})
            for (const double open : {0.0, 0.2})
                for (const int num_materials : {1, 3})
                {
                    SCOPED_TRACE(testing::Message() << seed << " " << share << " " << open
                                                    << " " << num_materials);
                    expect_blocks(RandomMaterial(seed, num_materials, share, open));
                }
}

TEST(MaterialBlocks, write_their_voxels_as_runs)
{
    const RandomMaterial of(7, 2, 0.6, 0.1);
    const MaterialBlocks blocks(of.grid, of.notches);
    std::mt19937 rng(2);
    std::vector<MaterialBlocks::Bits> some;
    std::set<std::size_t> wanted;
    for (std::size_t part = 0; part < blocks.size(); ++part)
        if (rng() % 3 != 0)
        {
            some.push_back({blocks.block(part), blocks.voxels(part)});
            for_each_bit(blocks.voxels(part),
                         [&](int bit)
                         {
                             wanted.insert(
                                 of.grid.index(blocks.first_voxel(blocks.block(part)) +
                                               place_of_bit(bit)));
                         });
        }
    std::vector<std::size_t> found;
    blocks.runs_of(some).for_each([&](std::size_t voxel) { found.push_back(voxel); });
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    EXPECT_EQ(std::set<std::size_t>(found.begin(), found.end()), wanted);
    EXPECT_EQ(found.size(), wanted.size());
}

} // namespace cellwarp::core
