// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/shared_marks.h"

#include <random>

#include <gtest/gtest.h>

#include "octree/base/parallel.h"

namespace cellwarp::core
{

TEST(SharedMarks, of_many_threads_are_all_there_and_nothing_else_is)
{
    constexpr std::size_t kVoxels = 100'000, kMarks = 400'000;
    std::mt19937 rng(9);
    struct Mark
    {
        std::size_t voxel;
        std::uint8_t bits;
    };
    std::vector<Mark> all(kMarks);
    VoxelFlags wanted(kVoxels);
    for (Mark& mark : all)
    {
        // Few pages, so that threads meet.
        mark = {rng() % (rng() % 2 ? kVoxels : 5000),
                static_cast<std::uint8_t>(1u << rng() % 8)};
        wanted[mark.voxel] |= mark.bits;
    }
    VoxelFlags flags(kVoxels);
    SharedMarks marks(flags);
    EXPECT_FALSE(marks.has(17, 1));
    parallel_for(all.size(), 512,
                 [&](std::size_t k) { marks.add(all[k].voxel, all[k].bits); });
    EXPECT_TRUE(flags == wanted);
    for (const Mark& mark : all)
        EXPECT_TRUE(marks.has(mark.voxel, mark.bits));
}

TEST(SharedMarks, are_there_only_with_all_their_bits)
{
    VoxelFlags flags(10);
    SharedMarks marks(flags);
    marks.add(4, 1);
    EXPECT_TRUE(marks.has(4, 1));
    EXPECT_FALSE(marks.has(4, 3));
    EXPECT_FALSE(marks.has(5, 1));
    marks.add(4, 2);
    EXPECT_TRUE(marks.has(4, 3));
}

} // namespace cellwarp::core
