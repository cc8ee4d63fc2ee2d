// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/number.h"

#include <bit>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <random>

#include <gtest/gtest.h>

namespace cellwarp
{

TEST(Number, reads_what_the_formats_write)
{
    EXPECT_EQ(parse_double("1.5"), 1.5);
    EXPECT_EQ(parse_double("+.5"), 0.5);
    EXPECT_EQ(parse_double("-1."), -1.0);
    EXPECT_EQ(parse_double("1e-3"), 1e-3);
    EXPECT_EQ(parse_double("1E+02"), 100.0);
}

TEST(Number, refuses_what_is_not_wholly_a_number)
{
    for (const char* token :
         {"", "x", "1x", "1.5.2", "--1", "+-1", "1,5", "0x10", "e5", "+"})
        EXPECT_FALSE(parse_double(token)) << token;
    for (const char* token : {"", "1.0", "1x", "18446744073709551617", "+-1"})
        EXPECT_FALSE(parse_integer(token)) << token;
}

TEST(Number, overflows_to_infinity_and_underflows_to_zero)
{
    EXPECT_EQ(parse_double("1e400"), INFINITY);
    EXPECT_EQ(parse_double("-1e400"), -INFINITY);
    EXPECT_EQ(parse_double("1e-400"), 0.0);
    EXPECT_EQ(parse_double("0." + std::string(400, '0') + "1"), 0.0);
    EXPECT_EQ(parse_double(std::string(400, '9')), INFINITY);
}

TEST(Number, the_shortest_text_reads_back_to_the_bit)
{
    std::mt19937_64 rng(1);
    for (int i = 0; i < 10000; ++i)
    {
        const double value = std::bit_cast<double>(rng());
        if (std::isfinite(value))
        {
            EXPECT_EQ(parse_double(shortest(value)), value);
        }
    }
    EXPECT_EQ(shortest(0.1), "0.1");
}

TEST(Number, does_not_depend_on_the_locale)
{
    const std::string before = std::setlocale(LC_ALL, nullptr);
    for (const char* name : {"de_DE.UTF-8", "C.UTF-8"})
        if (std::setlocale(LC_ALL, name))
        {
            EXPECT_EQ(parse_double("1.5"), 1.5);
        }
    std::setlocale(LC_ALL, before.c_str());
    EXPECT_EQ(shortest(1.5), "1.5");
}

TEST(Number, quotes_are_short_and_printable)
{
    EXPECT_EQ(in_quotes("ab\ncd"), "'ab?cd'");
    EXPECT_LT(in_quotes(std::string(1000, 'x')).size(), 50u);
}

TEST(Number, bytes_are_told_in_words)
{
    EXPECT_EQ(in_bytes(1.42e9), "1.4 GB");
    EXPECT_EQ(in_bytes(340.4e6), "340 MB");
    EXPECT_EQ(in_bytes(12300), "0 MB");
    EXPECT_EQ(in_bytes(1.26e6), "1.3 MB");
}

} // namespace cellwarp
