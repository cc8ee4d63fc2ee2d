// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/offsets.h"

#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace cellwarp
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

} // namespace cellwarp
