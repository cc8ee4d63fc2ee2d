// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/selection.h"

#include <random>
#include <set>

#include <gtest/gtest.h>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

namespace
{

using Runs = std::vector<SampleRun>;
using Samples = std::vector<std::uint32_t>;

Selection of(std::size_t num_samples, const Runs& runs)
{
    return Selection(num_samples, runs);
}

/// Samples in a row, each joined to the next by a face of two corners.
Neighbours row(std::uint32_t count, std::uint32_t cut_before = 0)
{
    Geometry geometry;
    for (std::uint32_t i = 0; i < count; ++i)
    {
        geometry.samples.emplace_back(i, 0, 0);
        if (i == 0 || i == cut_before)
            continue;
        geometry.corners.insert(geometry.corners.end(), {i - 1, i});
        geometry.face_ends.push_back(geometry.corners.size());
    }
    return Neighbours(geometry, geometry.samples);
}

} // namespace

TEST(Selection, runs_are_ascending_and_never_touch)
{
    Selection selection(200);
    for (const std::size_t i : {130, 3, 63, 64, 65, 199, 4, 0})
        selection.add(i);
    EXPECT_EQ(selection.runs(), (Runs{{0, 0}, {3, 4}, {63, 65}, {130, 130}, {199, 199}}));
    EXPECT_EQ(selection.samples(), (Samples{0, 3, 4, 63, 64, 65, 130, 199}));
    EXPECT_EQ(of(200, selection.runs()), selection);
}

TEST(Selection, counts_a_sample_once_however_often_it_is_added_or_removed)
{
    Selection selection(70);
    EXPECT_TRUE(selection.empty());
    selection.add(69);
    selection.add(69);
    EXPECT_EQ(selection.count(), 1u);
    EXPECT_TRUE(selection.holds(69));
    selection.remove(69);
    selection.remove(69);
    selection.remove(5);
    EXPECT_EQ(selection.count(), 0u);
    EXPECT_EQ(selection, Selection(70));
}

TEST(Selection, agrees_with_a_set_of_numbers_in_random_use)
{
    std::mt19937 rng(7);
    for (const std::size_t size : {1u, 63u, 64u, 65u, 300u})
    {
        SCOPED_TRACE(size);
        Selection selection(size);
        std::set<std::uint32_t> set;
        for (int step = 0; step < 500; ++step)
        {
            const auto i = static_cast<std::uint32_t>(rng() % size);
            if (rng() % 2)
            {
                selection.add(i);
                set.insert(i);
            }
            else
            {
                selection.remove(i);
                set.erase(i);
            }
        }
        EXPECT_EQ(selection.samples(), Samples(set.begin(), set.end()));
        EXPECT_EQ(selection.count(), set.size());
    }
}

TEST(Selection, a_difference_taken_twice_gives_the_other_set_back)
{
    const Selection a = of(100, {{0, 70}}), b = of(100, {{60, 99}});
    const Selection toggled = a.difference(b);
    EXPECT_EQ(toggled.runs(), (Runs{{0, 59}, {71, 99}}));
    EXPECT_EQ(toggled.count(), 89u);
    EXPECT_EQ(a.difference(toggled), b);
}

TEST(Selection, is_replaced_added_to_and_subtracted_from)
{
    const Selection old = of(10, {{0, 5}}), chosen = of(10, {{4, 7}});
    EXPECT_EQ(combined(old, chosen, SelectMode::Replace), chosen);
    EXPECT_EQ(combined(old, chosen, SelectMode::Add).runs(), (Runs{{0, 7}}));
    EXPECT_EQ(combined(old, chosen, SelectMode::Subtract).runs(), (Runs{{0, 3}}));
}

TEST(Selection, inverted_holds_every_other_sample_and_none_beyond_the_last)
{
    const Selection selection = inverted(of(65, {{1, 63}}));
    EXPECT_EQ(selection.runs(), (Runs{{0, 0}, {64, 64}}));
    EXPECT_EQ(inverted(Selection(65)).count(), 65u);
    EXPECT_EQ(inverted(inverted(selection)), selection);
    EXPECT_EQ(inverted(Selection()).count(), 0u);
}

TEST(Selection, grows_and_shrinks_by_one_neighbour)
{
    const Neighbours neighbours = row(10);
    EXPECT_EQ(grown(of(10, {{4, 5}}), neighbours).runs(), (Runs{{3, 6}}));
    EXPECT_EQ(shrunk(of(10, {{3, 6}}), neighbours).runs(), (Runs{{4, 5}}));
    // The end of the shape is no border.
    EXPECT_EQ(shrunk(of(10, {{0, 4}}), neighbours).runs(), (Runs{{0, 3}}));
    EXPECT_TRUE(shrunk(of(10, {{4, 5}}), neighbours).empty());
}

TEST(Selection, connected_stops_at_a_gap)
{
    const Neighbours neighbours = row(10, 6);
    EXPECT_EQ(connected(of(10, {{2, 2}}), neighbours).runs(), (Runs{{0, 5}}));
    EXPECT_EQ(connected(of(10, {{0, 0}, {9, 9}}), neighbours).count(), 10u);
    EXPECT_TRUE(connected(Selection(10), neighbours).empty());
}

} // namespace cellwarp::core
