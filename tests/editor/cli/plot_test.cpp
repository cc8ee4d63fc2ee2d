// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/plot.h"

#include <cmath>
#include <cstdlib>

#include <gtest/gtest.h>

#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;

namespace
{

std::size_t count(const std::string& text, const std::string& part)
{
    std::size_t found = 0;
    for (std::size_t at = text.find(part); at != std::string::npos;
         at = text.find(part, at + 1))
        ++found;
    return found;
}

/// The number behind the n-th appearance of a mark.
double number_after(const std::string& svg, const std::string& mark, int n = 0)
{
    std::size_t at = svg.find(mark);
    for (; n > 0; --n)
        at = svg.find(mark, at + 1);
    EXPECT_NE(at, std::string::npos) << mark;
    return std::strtod(svg.c_str() + at + mark.size(), nullptr);
}

LogPlot line_of(std::vector<PlotPoint> points)
{
    return {
        "t", "x", "y", {{"s", "#123456", false, Marker::Disc, std::move(points)}}, 0.0};
}

/// Where the n-th disc is.
double disc_x(const std::string& svg, int n)
{
    return number_after(svg, "<circle cx=\"", n);
}
double disc_y(const std::string& svg, int n)
{
    return number_after(svg, " cy=\"", n);
}

} // namespace

TEST(Plot, equal_factors_are_equal_lengths)
{
    const std::string svg =
        svg_of(line_of({{1, 1e-4, "", ""}, {10, 1e-3, "", ""}, {100, 1e-2, "", ""}}));
    EXPECT_NEAR(disc_x(svg, 1) - disc_x(svg, 0), disc_x(svg, 2) - disc_x(svg, 1), 0.11);
    EXPECT_NEAR(disc_y(svg, 0) - disc_y(svg, 1), disc_y(svg, 1) - disc_y(svg, 2), 0.11);
    EXPECT_GT(disc_x(svg, 1), disc_x(svg, 0));
    EXPECT_LT(disc_y(svg, 1), disc_y(svg, 0));
}

TEST(Plot, decades_are_labelled_and_few_of_them_more_finely)
{
    const std::string wide = svg_of(line_of({{1, 1e-7, "", ""}, {1000, 1e-3, "", ""}}));
    EXPECT_TRUE(contains(wide, ">100</text>"));
    EXPECT_TRUE(contains(wide, "10<tspan dy=\"-5\" font-size=\"9\">\u22125</tspan>"));
    EXPECT_FALSE(contains(wide, ">200</text>"));
    const std::string narrow = svg_of(line_of({{1.1, 0.2, "", ""}, {4.5, 0.3, "", ""}}));
    EXPECT_TRUE(contains(narrow, ">2</text>"));
    EXPECT_TRUE(contains(narrow, ">5</text>"));
    EXPECT_TRUE(contains(narrow, ">0.5</text>"));
}

TEST(Plot, one_point_or_none_has_a_plot)
{
    const std::string one = svg_of(line_of({{3, 3, "", ""}}));
    EXPECT_EQ(count(one, "<circle"), 2u); // with the legend's
    EXPECT_FALSE(contains(one, "nan"));
    EXPECT_TRUE(contains(svg_of(line_of({})), "nothing to draw"));
}

TEST(Plot, points_without_a_logarithm_are_left_out)
{
    const std::string svg = svg_of(line_of({{1, 0, "", ""},
                                            {0, 1, "", ""},
                                            {1, NAN, "", ""},
                                            {INFINITY, 1, "", ""},
                                            {-1, 1, "", ""},
                                            {1, 1, "", ""},
                                            {2, 2, "", ""}}));
    EXPECT_EQ(count(svg, "<circle"), 2u + 1);
    EXPECT_FALSE(contains(svg, "nan"));
    EXPECT_FALSE(contains(svg, "inf"));
}

TEST(Plot, what_is_below_the_floor_is_a_triangle_at_the_border)
{
    LogPlot plot = line_of({{1, 1, "", ""}, {2, 1e-12, "", ""}});
    plot.y_floor = 1e-3;
    const std::string svg = svg_of(plot);
    EXPECT_EQ(count(svg, "<circle"), 1u + 1);
    EXPECT_EQ(count(svg, "z\" fill=\"#123456\""), 1u);
    EXPECT_FALSE(contains(svg, "\u221212"));
}

TEST(Plot, labels_do_not_stand_on_each_other)
{
    const std::string svg = svg_of(
        line_of({{1, 1, "here", ""}, {1.01, 1.01, "here", ""}, {9, 9, "there", ""}}));
    EXPECT_EQ(count(svg, ">here</text>"), 1u);
    EXPECT_EQ(count(svg, ">there</text>"), 1u);
}

TEST(Plot, words_are_escaped)
{
    EXPECT_EQ(in_markup("a<b>&\"c',\n"), "a&lt;b&gt;&amp;&quot;c&#39;, ");
    LogPlot plot = line_of({{1, 1, "<l>", "<t>"}});
    plot.title = plot.x_label = plot.y_label = plot.series[0].name = "<&>";
    const std::string svg = svg_of(plot);
    EXPECT_EQ(count(svg, "&lt;&amp;&gt;"), 5u);
    EXPECT_TRUE(contains(svg, "&lt;l&gt;") && contains(svg, "<title>&lt;t&gt;</title>"));
}

} // namespace cellwarp::core
