// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/error.h"

#include <type_traits>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(Error, holds_its_place_in_parts_and_makes_the_text_when_it_is_asked)
{
    const Error error = malformed({"a.obj", 12, "vertex 3"}, "got 'x', need a number");
    EXPECT_EQ(error.fault(), Fault::Malformed);
    EXPECT_EQ(error.file(), "a.obj");
    EXPECT_EQ(error.line(), 12);
    EXPECT_EQ(error.field(), "vertex 3");
    EXPECT_EQ(error.message(), "got 'x', need a number");
    EXPECT_STREQ(error.what(), "a.obj:12: vertex 3: got 'x', need a number");
    const Error copy = error;
    EXPECT_STREQ(copy.what(), error.what());
    EXPECT_TRUE(std::is_nothrow_copy_constructible_v<Error>);
}

TEST(Error, leaves_out_of_the_text_what_is_not_known)
{
    EXPECT_STREQ(Error(Fault::Budget, "too much").what(), "too much");
    EXPECT_STREQ(Error(Fault::File, at({"a", 0, ""}, "is gone")).what(), "a: is gone");
    EXPECT_STREQ(wrong_flag("--size", "got '1'").what(), "--size: got '1'");
    EXPECT_EQ(wrong_flag("--size", "got '1'").field(), "--size");
    EXPECT_EQ(wrong_flag("--size", "got '1'").fault(), Fault::Usage);
    const std::string warning = at({"a.json", 4, "cells"}, "unknown key");
    EXPECT_EQ(warning, "a.json:4: cells: unknown key");
}

} // namespace cellwarp::core
