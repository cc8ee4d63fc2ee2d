// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/weight_file.h"

#include <gtest/gtest.h>

#include "io/error.h"
#include "tests/support/throws.h"

namespace cellwarp
{

using support::contains;
using support::error_of;

TEST(WeightFile, lines_are_samples_and_columns_joints)
{
    const PaintedWeights weights =
        parse_weights("w.txt", "cellwarp-weights 1 # by hand\n\n"
                               "root, \"left arm\" head\n"
                               "1,0,0\r\n0.25\t0.5 0.25 # mixed\n0 0 2e0\n");
    ASSERT_EQ(weights.joints, (std::vector<std::string>{"root", "left arm", "head"}));
    ASSERT_EQ(weights.num_samples(), 3u);
    EXPECT_EQ(weights.values, (std::vector<double>{1, 0, 0, 0.25, 0.5, 0.25, 0, 0, 2}));
}

TEST(WeightFile, what_is_wrong_is_told_with_its_line)
{
    for (const auto& [text, words] :
         {std::pair<std::string, std::string>{"", "names no joints"},
          {"cellwarp-weights 2\na\n", "w.txt:1: the first line is wrong"},
          {"cellwarp-weights 1\na a\n", "w.txt:2: a: is named twice"},
          {"cellwarp-weights 1\na b\n1 2\n1\n",
           "w.txt:4: got 1 numbers, need one a joint, 2"},
          {"cellwarp-weights 1\na b\n1 -2\n", "w.txt:3: b: got '-2', need a number >= 0"},
          {"cellwarp-weights 1\na b\n1 nan\n", "need a number >= 0"},
          {"cellwarp-weights 1\na b\n1 1e308\n", "need a number >= 0"},
          {"cellwarp-weights 1\n\"a b\n", "w.txt:2: a double quote is not closed"}})
    {
        const std::string found = error_of(Fault::Malformed, [&, input = text]
                                           { parse_weights("w.txt", input); });
        EXPECT_TRUE(contains(found, words)) << found;
    }
    error_of(Fault::File, [] { read_weights("/nowhere/w.txt"); });
}

} // namespace cellwarp
