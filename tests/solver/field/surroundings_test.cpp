// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/surroundings.h"

#include <atomic>

#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "tests/support/bodies.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kRoom = std::size_t(1) << 24;

/// Around a whole cell.
Surroundings made_for(const support::Built& built, int cell)
{
    const Cell& box = built.cells.cells[idx(cell)];
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * box.edge);
    Surroundings made;
    made.cells.find(ClosestCells(built.cells), cell, box.box_centre - half,
                    box.box_centre + half);
    return made;
}

} // namespace

TEST(KeptSurroundings, are_made_once_for_each_octant_and_box)
{
    const support::Built bar = support::bar(3, 3, 6);
    KeptSurroundings kept(bar.cells.size(), kRoom);
    int num_made = 0;
    for (int again = 0; again < 2; ++again)
        for (int cell = 0; cell < static_cast<int>(bar.cells.size()); ++cell)
            for (std::size_t part = 0; part <= kWholeBox; ++part)
            {
                const Surroundings* const found = kept.get(cell, part,
                                                           [&]
                                                           {
                                                               ++num_made;
                                                               return made_for(bar, cell);
                                                           });
                ASSERT_TRUE(found);
                EXPECT_EQ(found->cells.own(), cell);
            }
    EXPECT_EQ(num_made, static_cast<int>((kOctants + 1) * bar.cells.size()));
}

TEST(KeptSurroundings, are_no_more_than_there_is_room_for)
{
    const support::Built bar = support::bar(3, 3, 6);
    const std::size_t table = (kOctants + 1) * bar.cells.size() * sizeof(void*);
    const std::size_t one = made_for(bar, 0).num_bytes();
    KeptSurroundings kept(bar.cells.size(), 2 * table + 5 * one);
    std::size_t num_kept = 0, bytes = table;
    for (int cell = 0; cell < static_cast<int>(bar.cells.size()); ++cell)
        if (const Surroundings* const found =
                kept.get(cell, 0, [&] { return made_for(bar, cell); }))
        {
            ++num_kept;
            bytes += found->num_bytes();
        }
    EXPECT_GT(num_kept, 3u);
    EXPECT_LT(num_kept, bar.cells.size());
    EXPECT_LT(bytes, 2 * table + 8 * one); // the last one may go over it
    KeptSurroundings none(bar.cells.size(), table);
    EXPECT_FALSE(none.get(0, 0, [&] { return made_for(bar, 0); }));
}

TEST(KeptSurroundings, wait_until_there_are_points_enough)
{
    KeptSurroundings kept(10, kRoom);
    EXPECT_FALSE(kept.expect(4 * 8 * 10 - 1));
    EXPECT_TRUE(kept.expect(1));
    EXPECT_TRUE(kept.expect(1));
}

TEST(KeptSurroundings, are_the_same_for_all_threads)
{
    const support::Built bar = support::bar(3, 3, 6);
    KeptSurroundings kept(bar.cells.size(), kRoom);
    std::vector<std::atomic<const Surroundings*>> first(bar.cells.size());
    std::atomic<int> num_others = 0;
    parallel_for(200 * bar.cells.size(),
                 [&](std::size_t i)
                 {
                     const std::size_t c = i % bar.cells.size();
                     const int cell = static_cast<int>(c);
                     const Surroundings* const found =
                         kept.get(cell, 3, [&] { return made_for(bar, cell); });
                     const Surroundings* known = nullptr;
                     if (!first[c].compare_exchange_strong(known, found))
                         num_others += known != found;
                 });
    EXPECT_EQ(num_others, 0);
}

} // namespace cellwarp::core
