// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/number.h"

#include <bit>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
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

TEST(Number, beyond_the_largest_and_below_the_smallest_are_told_apart)
{
    const std::string zeros(400, '0');
    const double inf = std::numeric_limits<double>::infinity();
    EXPECT_EQ(parse_double("1" + zeros + "e-50"), inf);
    EXPECT_EQ(parse_double("10e9223372036854775807"), inf);
    EXPECT_EQ(parse_double("0.01e-9223372036854775807"), 0.0);
    EXPECT_EQ(parse_double("-1" + zeros + ".5e-50"), -inf);
    EXPECT_EQ(parse_double("1e400"), inf);
    EXPECT_EQ(parse_double("0." + zeros + "1e+900"), inf);
    EXPECT_EQ(parse_double("1e99999999999999999999"), inf);
    EXPECT_EQ(parse_double("0." + zeros + "1e50"), 0.0);
    EXPECT_EQ(parse_double("1e-400"), 0.0);
    EXPECT_EQ(parse_double("." + zeros + "1"), 0.0);
    EXPECT_EQ(parse_double("1e-99999999999999999999"), 0.0);
    EXPECT_EQ(parse_double("1" + zeros + "e-800"), 0.0);
}

TEST(Number, what_old_libraries_write_for_no_number_is_known)
{
    EXPECT_EQ(parse_double("-1.#INF"), -std::numeric_limits<double>::infinity());
    EXPECT_EQ(parse_double("1.#INF00"), std::numeric_limits<double>::infinity());
    for (const char* text : {"-1.#IND", "1.#QNAN0", "1.#SNAN", "-nan(ind)", "nan"})
        EXPECT_TRUE(std::isnan(parse_double(text).value_or(0.0))) << text;
    for (const char* text : {"1.#", "1.#IN", "1.#INFx", "2.#INF", "#INF", "1.#IND5"})
        EXPECT_FALSE(parse_double(text)) << text;
}

} // namespace cellwarp::core
