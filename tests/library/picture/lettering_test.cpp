// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/picture/lettering.h"

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

Image white(int width, int height)
{
    Image image{width, height, {}};
    image.rgb.assign(
        3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 255);
    return image;
}

/// The columns and rows that are not white any more: left, right, upper, lower.
std::array<int, 4> inked(const Image& image)
{
    std::array<int, 4> box = {image.width, -1, image.height, -1};
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            if (image.rgb[3 * static_cast<std::size_t>(y * image.width + x)] < 255)
                box = {std::min(box[0], x), std::max(box[1], x), std::min(box[2], y),
                       std::max(box[3], y)};
    return box;
}

} // namespace

TEST(Lettering, stands_around_the_place_where_it_is_drawn)
{
    const Lettering lettering(20.0);
    Image image = white(200, 60);
    lettering.draw("0.25", 100.0, 30.0, {0, 0, 0}, image);
    const auto [left, right, upper, lower] = inked(image);
    EXPECT_NEAR(0.5 * (left + right), 100.0, 2.5);
    EXPECT_NEAR(0.5 * (upper + lower), 30.0, 1.5);
    EXPECT_NEAR(right - left, lettering.width("0.25"), 4.0);
    EXPECT_GT(lower - upper, 10);
    EXPECT_LT(lower - upper, 20);
}

TEST(Lettering, grows_with_its_height)
{
    EXPECT_NEAR(Lettering(40.0).width("bar.obj"), 2.0 * Lettering(20.0).width("bar.obj"),
                1e-3);
    EXPECT_GT(Lettering(20.0).width("bars.obj"), Lettering(20.0).width("bar.obj"));
    EXPECT_EQ(Lettering(20.0).width(""), 0.0);
}

TEST(Lettering, beyond_the_picture_is_left_out)
{
    const Lettering lettering(20.0);
    Image image = white(30, 10);
    for (const double x : {-1000.0, 0.0, 30.0, 1000.0})
        for (const double y : {-50.0, 0.0, 10.0, 60.0})
            lettering.draw("wide letters", x, y, {0, 0, 0}, image);
    EXPECT_EQ(image.rgb.size(), 900u);
    EXPECT_EQ(inked(image)[0], 0);
}

TEST(Lettering, takes_utf_8_and_bytes_that_are_none)
{
    const Lettering lettering(20.0);
    EXPECT_LT(lettering.width("\xc3\xa4"), lettering.width("ae"));
    EXPECT_EQ(lettering.width("\xff"), lettering.width("?"));
    EXPECT_EQ(lettering.width("a\xc3"), lettering.width("a?"));
    EXPECT_EQ(lettering.width("\x80"), lettering.width("?"));
}

} // namespace cellwarp::core
