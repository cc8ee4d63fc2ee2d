// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/lzf.h"

#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(Lzf, unpacks_literals_and_references)
{
    using namespace std::literals;
    // "abc", then 7 bytes from 3 before, then 12 from 1 before (a long reference).
    EXPECT_EQ(lzf_unpacked("\x02"
                           "abc\xa0\x02\xe0\x03\x00"sv,
                           22),
              "abcabcabcaaaaaaaaaaaaa");
    EXPECT_EQ(lzf_unpacked("", 0), "");
}

TEST(Lzf, what_is_packed_unpacks_to_the_same)
{
    std::mt19937 random(1);
    for (const std::size_t size : {0, 1, 2, 3, 4, 31, 32, 33, 263, 264, 265, 9000, 70000})
        for (const unsigned values : {1u, 2u, 5u, 256u})
        {
            std::string bytes(size, '\0');
            for (char& c : bytes)
                c = static_cast<char>(random() % values);
            const std::string packed = *lzf_packed(bytes);
            EXPECT_LE(packed.size(), size + size / 32 + 1);
            EXPECT_LE(size, packed.size() * kMaxLzfRatio);
            EXPECT_EQ(lzf_unpacked(packed, size), bytes) << size << " of " << values;
        }
    EXPECT_LT(lzf_packed(std::string(70000, 'x'))->size(), 1000u);
}

TEST(Lzf, data_that_is_cut_or_lies_unpacks_to_nothing)
{
    const std::string bytes = "abcabcabcabcabcabcabcabc and something else";
    const std::string packed = *lzf_packed(bytes);
    for (std::size_t size = 0; size < packed.size(); ++size)
        EXPECT_FALSE(lzf_unpacked(packed.substr(0, size), bytes.size())) << size;
    EXPECT_FALSE(lzf_unpacked(packed, bytes.size() - 1));
    EXPECT_FALSE(lzf_unpacked(packed, bytes.size() + 1));
    EXPECT_FALSE(lzf_unpacked(std::string("\x20\x00", 2), 3)) << "before the beginning";
    EXPECT_FALSE(lzf_unpacked("", 3));
    EXPECT_FALSE(lzf_unpacked(packed, 0));
}

TEST(Lzf, what_was_packed_before_makes_no_difference)
{
    std::mt19937 random(2);
    const auto some_bytes = [&](unsigned values)
    {
        std::string bytes(20000, '\0');
        for (char& c : bytes)
            c = static_cast<char>(random() % values);
        return bytes;
    };
    for (const unsigned values : {2u, 5u, 30u})
    {
        const std::string bytes = some_bytes(values);
        const std::optional<std::string> first = lzf_packed(bytes);
        for (int other = 0; other < 10; ++other)
        {
            lzf_packed(some_bytes(values));
            EXPECT_EQ(lzf_packed(bytes), first) << values;
        }
    }
}

} // namespace cellwarp::core
