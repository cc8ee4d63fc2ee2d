// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/typed_number.h"

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

TypedNumber typed(const std::string& keys)
{
    TypedNumber number;
    for (const char key : keys)
        number.put(key);
    return number;
}

} // namespace

TEST(TypedNumber, is_what_the_keys_say)
{
    EXPECT_EQ(typed("12.5").value(), 12.5);
    EXPECT_EQ(typed("-12.5").value(), -12.5);
    EXPECT_EQ(typed("12,5").value(), 12.5);
    EXPECT_EQ(typed(".5").value(), 0.5);
    EXPECT_EQ(typed("3.").value(), 3.0);
    EXPECT_EQ(typed("1.2.3").text(), "1.23");
    EXPECT_EQ(typed("12.5-").text(), "-12.5"); // changes the sign
    EXPECT_EQ(typed("-5-").value(), 5.0);
}

TEST(TypedNumber, is_none_before_there_is_a_digit)
{
    EXPECT_FALSE(typed("").value());
    EXPECT_FALSE(typed("-").value());
    EXPECT_FALSE(typed("-.").value());
    EXPECT_TRUE(typed("").empty());
    EXPECT_FALSE(typed("-").empty());
}

TEST(TypedNumber, backspace_takes_back_key_by_key)
{
    TypedNumber number = typed("-1.5");
    number.backspace();
    EXPECT_EQ(number.text(), "-1.");
    number.backspace();
    number.backspace();
    EXPECT_EQ(number.text(), "-");
    number.backspace();
    number.backspace();
    EXPECT_TRUE(number.empty());
}

TEST(TypedNumber, takes_no_letters_and_no_more_digits_than_count)
{
    TypedNumber number;
    EXPECT_FALSE(number.put('x'));
    EXPECT_FALSE(number.put('e'));
    EXPECT_TRUE(number.put('7'));
    EXPECT_FALSE(number.put(' '));
    for (int i = 0; i < 1000; ++i)
        number.put('9');
    EXPECT_EQ(number.text().size(), 15u);
    EXPECT_EQ(number.value(), 799999999999999.0);
}

} // namespace cellwarp::core
