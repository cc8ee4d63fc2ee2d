// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/json_text.h"

#include <string>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

std::string at(std::string_view text, std::optional<TextRange> range)
{
    return range ? std::string(text.substr(range->begin, range->end - range->begin))
                 : "none";
}

} // namespace

TEST(JsonText, finds_members_and_items_where_they_stand)
{
    const std::string_view text =
        "\xef\xbb\xbf { \"a\" : [1 , {\"b\":\"],}\\\"\"},[ ] ,-2e3], \"s\\\"\":true ,"
        "\"\\u0061b\":{}, \"twice\":1,\"twice\": 2 } ";
    const TextRange root = json_root(text);
    const std::optional<TextRange> list = json_member(text, root, "a");
    ASSERT_TRUE(list);
    const std::vector<TextRange> items = json_items(text, *list);
    ASSERT_EQ(items.size(), 4u);
    EXPECT_EQ(at(text, items[0]), "1");
    EXPECT_EQ(at(text, json_member(text, items[1], "b")), "\"],}\\\"\"");
    EXPECT_EQ(at(text, items[2]), "[ ]");
    EXPECT_TRUE(json_items(text, items[2]).empty());
    EXPECT_EQ(at(text, items[3]), "-2e3");
    EXPECT_EQ(at(text, json_member(text, root, "ab")), "{}");
    EXPECT_EQ(at(text, json_member(text, root, "twice")), "2");
    EXPECT_EQ(at(text, json_member(text, root, "b")), "none");
}

TEST(JsonText, brackets_in_quotes_have_no_depth)
{
    EXPECT_EQ(json_depth("{\"a[[[\\\"[\": [[1], {}]}"), 3u);
    EXPECT_EQ(json_depth("]]]]"), 0u);
    EXPECT_EQ(json_depth(std::string(100000, '[')), 100000u);
    EXPECT_EQ(json_depth("\"[[["), 0u);
}

} // namespace cellwarp::core
