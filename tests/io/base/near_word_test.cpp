// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/near_word.h"

#include <vector>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(NearestWord, is_the_one_that_differs_by_the_fewest_letters)
{
    const std::vector<std::string> words{"deform", "info", "render", "check"};
    EXPECT_EQ(nearest_word("defrom", words), "deform");
    EXPECT_EQ(nearest_word("chek", words), "check");
    EXPECT_EQ(nearest_word("renders", words), "render");
    EXPECT_EQ(nearest_word("render", words), "render");
}

TEST(NearestWord, is_none_where_too_many_letters_differ)
{
    const std::vector<std::string> words{"deform", "info"};
    EXPECT_EQ(nearest_word("simulate", words), "");
    EXPECT_EQ(nearest_word("no", words), ""); // half of two letters is one
    EXPECT_EQ(nearest_word("", words), "");
    EXPECT_EQ(nearest_word("info", {}), "");
}

} // namespace cellwarp::core
