// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/large_pages.h"

#include <cstdint>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(LargePages, a_list_keeps_what_it_holds_and_has_room)
{
    for (const std::size_t count : {0, 10, 5000000})
    {
        std::vector<std::uint32_t> list(count / 2);
        std::iota(list.begin(), list.end(), 7u);
        reserve_large(list, count);
        EXPECT_GE(list.capacity(), count);
        ASSERT_EQ(list.size(), count / 2);
        for (std::size_t i = 0; i < list.size(); ++i)
            ASSERT_EQ(list[i], 7u + i);
        list.resize(count, 1);
    }
}

} // namespace cellwarp::core
