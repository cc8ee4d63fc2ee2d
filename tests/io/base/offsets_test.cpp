// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/offsets.h"

#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(Offsets, are_what_was_put_in_on_both_sides_of_every_4_gb)
{
    const std::vector<std::uint64_t> places = {
        0,           7,           0xfffffffd,  0xffffffff, 0x100000000,
        0x100000004, 0xfffffff0,  0x2ffffffff, 0,          0xffffffffffffffff,
        12,          0x500000000, 0x500000001};
    Offsets offsets;
    offsets.append(places.begin(), places.end());
    ASSERT_EQ(offsets.size(), places.size());
    for (std::size_t i = 0; i < places.size(); ++i)
        EXPECT_EQ(offsets[i], places[i]) << i;
}

TEST(Offsets, are_equal_to_those_that_took_another_way)
{
    std::mt19937_64 rng(1);
    std::vector<std::uint64_t> places;
    Offsets offsets;
    for (int step = 0; step < 2000; ++step)
    {
        if (rng() % 8 == 0)
        {
            const std::size_t count = rng() % (places.size() + 1);
            places.resize(count);
            offsets.truncate(count);
        }
        else if (rng() % 8 == 0)
        {
            const std::size_t count = places.size() + rng() % 4;
            places.resize(count, 0);
            offsets.pad(count);
        }
        else
        {
            const std::uint64_t high = rng() % 3, low = rng() % 100;
            places.push_back(high << 32 | low);
            offsets.push_back(places.back());
        }
        Offsets anew;
        anew.append(places.begin(), places.end());
        ASSERT_EQ(offsets, anew) << step;
        ASSERT_EQ(offsets.size(), places.size());
        ASSERT_EQ(offsets.empty(), places.empty());
        for (std::size_t i = 0; i < places.size(); ++i)
            ASSERT_EQ(offsets[i], places[i]) << step << " " << i;
    }
    offsets.clear();
    EXPECT_EQ(offsets, Offsets());
}

TEST(TokenLengths, are_what_was_put_in_also_if_they_are_long)
{
    std::mt19937 rng(5);
    std::vector<std::size_t> wanted;
    TokenLengths lengths;
    for (int i = 0; i < 2000; ++i)
    {
        if (rng() % 50 == 0)
        {
            wanted.resize(rng() % (wanted.size() + 1));
            lengths.truncate(wanted.size());
        }
        if (rng() % 50 == 0)
        {
            wanted.resize(wanted.size() + rng() % 3, 0);
            lengths.pad(wanted.size());
        }
        wanted.push_back(rng() % 3 == 0 ? 250 + rng() % 10 : rng() % 300000);
        lengths.push_back(wanted.back());
        ASSERT_EQ(lengths.size(), wanted.size());
        ASSERT_EQ(lengths[wanted.size() - 1], wanted.back());
    }
    for (std::size_t i = 0; i < wanted.size(); ++i)
        ASSERT_EQ(lengths[i], wanted[i]);
}

TEST(RecordPlaces, are_those_of_the_records_that_count)
{
    // Three vectors a record, as the corners of a facet; some records are left out.
    std::mt19937 rng(6);
    RecordPlaces places;
    places.set_layout({{96, 100, 104}, {50, 50, 50}, 3, 12});
    std::vector<std::uint64_t> slots;
    for (std::uint64_t record = std::uint64_t(1) << 33; slots.size() < 3000; ++record)
    {
        if (rng() % 4 == 0)
            continue;
        places.add(3 * record, 3);
        slots.insert(slots.end(), {3 * record, 3 * record + 1, 3 * record + 2});
    }
    for (std::size_t i = 0; i < slots.size(); ++i)
    {
        std::uint64_t starts[3];
        places.starts(i, 3, starts);
        for (std::size_t k = 0; k < 3; ++k)
        {
            ASSERT_EQ(places.start(i, k),
                      96 + 50 * (slots[i] / 3) + 12 * (slots[i] % 3) + 4 * k);
            ASSERT_EQ(starts[k], places.start(i, k));
        }
    }
    // Columns, one after the other.
    RecordPlaces columns;
    columns.set_layout({{0, 800, 1600}, {8, 8, 2}});
    columns.add(0, 10);
    columns.add(11);
    EXPECT_EQ(columns.start(9, 1), 872u);
    EXPECT_EQ(columns.start(10, 2), 1622u);
    columns.clear();
    EXPECT_TRUE(columns.empty());
}

} // namespace cellwarp::core
