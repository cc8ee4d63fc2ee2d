// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/picture/axes.h"

#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Looking along -z at a box: x to the right, y up.
Projection front(double pixel)
{
    Projection view;
    view.right = Eigen::Vector3d::UnitX();
    view.up = Eigen::Vector3d::UnitY();
    view.back = Eigen::Vector3d::UnitZ();
    view.centre = Eigen::Vector3d(0.5, 0.5, 0.5);
    view.pixel = pixel;
    view.width = view.height = 200;
    return view;
}

Image white()
{
    Image image{200, 200, {}};
    image.rgb.assign(3 * 200 * 200, 255);
    return image;
}

bool is_dark(const Image& image, int x, int y)
{
    return image.rgb[3 * idx(y * image.width + x)] < 200;
}

} // namespace

TEST(Axes, have_round_numbers)
{
    EXPECT_EQ(ticks_between(0.0, 1.0),
              (std::vector<double>{0.0, 0.2, 0.4, 3 * 0.2, 0.8, 1.0}));
    EXPECT_EQ(ticks_between(-1.34, 1.34),
              (std::vector<double>{-1.0, -0.5, 0.0, 0.5, 1.0}));
    EXPECT_EQ(ticks_between(1e6, 1e6 + 3.0),
              (std::vector<double>{1e6, 1e6 + 0.5, 1e6 + 1, 1e6 + 1.5, 1e6 + 2, 1e6 + 2.5,
                                   1e6 + 3}));
    EXPECT_TRUE(ticks_between(2.0, 2.0).empty());
    for (const double size : {1e-9, 3e-4, 0.7, 12.0, 7.3e8})
        for (const double low : {-0.3, 0.0, 4.1})
        {
            const std::vector<double> ticks = ticks_between(low * size, (low + 1) * size);
            EXPECT_GE(ticks.size(), 3u) << low << " " << size;
            EXPECT_LE(ticks.size(), 8u) << low << " " << size;
        }
}

TEST(Axes, run_along_the_lower_and_the_left_edge_of_the_box)
{
    Image image = white();
    const Eigen::AlignedBox3d box(Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 1, 1));
    draw_axes(box, 1, front(0.01), Lettering(12.0), 0, image);
    // The box takes the columns and rows from 50 to 150.
    for (const int k : {60, 75, 95, 120, 140})
    {
        EXPECT_TRUE(is_dark(image, k, 149) || is_dark(image, k, 150)) << k;
        EXPECT_TRUE(is_dark(image, 49, k) || is_dark(image, 50, k)) << k;
        EXPECT_FALSE(is_dark(image, k, 50) || is_dark(image, k, 51)) << k;
        EXPECT_FALSE(is_dark(image, 150, k) || is_dark(image, 151, k)) << k;
    }
    // Numbers below and to the left, nothing within.
    int below = 0, beside = 0, within = 0;
    for (int y = 0; y < 200; ++y)
        for (int x = 0; x < 200; ++x)
        {
            below += is_dark(image, x, y) && y > 157;
            beside += is_dark(image, x, y) && x < 43;
            within += is_dark(image, x, y) && x > 53 && y < 146;
        }
    EXPECT_GT(below, 30);
    EXPECT_GT(beside, 30);
    EXPECT_EQ(within, 0);
}

TEST(Axes, that_are_seen_end_on_or_are_tiny_are_left_out)
{
    Image image = white();
    const Eigen::AlignedBox3d thin(Eigen::Vector3d(0.5, 0.5, -3),
                                   Eigen::Vector3d(0.5, 0.5, 9));
    draw_axes(thin, 1, front(0.01), Lettering(12.0), 0, image);
    EXPECT_EQ(image.rgb, white().rgb);
}

} // namespace cellwarp::core
