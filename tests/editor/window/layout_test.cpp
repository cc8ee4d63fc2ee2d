// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/layout.h"

#include <gtest/gtest.h>

#include "editor/window/panels.h"

namespace cellwarp::core
{

namespace
{

LayoutSizes sizes_of(int width, int height, float scale)
{
    return {width, height, 9.3f * scale, 24.0f * scale, kNumTools};
}

int end_of(const ViewRect& rect)
{
    return rect.x + rect.width;
}

} // namespace

TEST(Layout, has_room_for_every_tool_and_the_view_at_any_size_and_scale)
{
    struct Size
    {
        int width, height;
        float scale;
    };
    for (const auto& [width, height, scale] : {Size{1920, 1080, 1},
                                               {1400, 900, 1},
                                               {1024, 768, 1},
                                               {900, 600, 1},
                                               {1024, 768, 2},
                                               {1280, 720, 2},
                                               {2560, 1440, 3},
                                               {800, 600, 2}})
    {
        SCOPED_TRACE(testing::Message() << width << " x " << height << " @ " << scale);
        const LayoutSizes sizes = sizes_of(width, height, scale);
        const Layout layout = lay_out(sizes, {});
        const int columns = layout.num_columns,
                  rows = (kNumTools + columns - 1) / columns;
        const float side = layout.shows_names ? kToolHeight : kToolSide;
        const auto length = [&](int count) {
            return (static_cast<float>(count) * (side + kToolGap) + kToolGap) *
                   sizes.letter;
        };
        EXPECT_LE(length(columns), static_cast<float>(layout.tools.width + 1));
        EXPECT_LE(length(rows), static_cast<float>(layout.tools.height));
        // Side by side, and nothing is left over.
        EXPECT_EQ(layout.view.x, end_of(layout.tools));
        EXPECT_EQ(layout.splitter.x, end_of(layout.view));
        EXPECT_EQ(layout.panel.x, end_of(layout.splitter));
        EXPECT_EQ(end_of(layout.panel), width);
        EXPECT_EQ(layout.options.y + layout.options.height, layout.view.y);
        EXPECT_EQ(layout.view.y + layout.view.height, layout.status.y);
        EXPECT_GE(layout.view.width, 0.38 * width);
        EXPECT_GE(layout.view.height, 0.5 * height);
    }
}

TEST(Layout, has_a_panel_as_wide_as_it_was_dragged_or_none)
{
    const LayoutSizes sizes = sizes_of(1400, 900, 1);
    const PanelWish wish = wish_at(1000.0, sizes);
    EXPECT_TRUE(wish.is_shown);
    EXPECT_NEAR(lay_out(sizes, wish).splitter.x, 1000, 10);
    // As many letters on a display of another scale.
    EXPECT_NEAR(lay_out(sizes_of(2800, 1800, 2), wish).splitter.x, 2000, 20);
    // It leaves room for the view, and is never too narrow to be read.
    EXPECT_GT(lay_out(sizes, wish_at(0.0, sizes)).view.width, 150);
    const Layout narrow = lay_out(sizes, wish_at(1300.0, sizes));
    EXPECT_NEAR(narrow.panel.width, 18 * 9.3, 2.0);
    const Layout hidden = lay_out(sizes, wish_at(1395.0, sizes));
    EXPECT_EQ(hidden.panel.width, 0);
    EXPECT_EQ(end_of(hidden.splitter), 1400); // to be dragged out again
    EXPECT_EQ(hidden.view.width, 1400 - hidden.tools.width - hidden.splitter.width);
}

TEST(Layout, gives_the_view_all_the_room_if_nothing_is_open)
{
    const Layout layout = lay_out({1000, 700, 9.3f, 24.0f, 0}, {});
    EXPECT_EQ(layout.view.width, 1000);
    EXPECT_EQ(layout.view.y, 24);
    EXPECT_EQ(layout.tools.width, 0);
}

TEST(Layout, of_a_window_without_room_has_no_negative_sizes)
{
    for (const int side : {0, 1, 40, 100})
    {
        const Layout layout = lay_out(sizes_of(side, side, 2), {});
        for (const ViewRect& part : {layout.tools, layout.options, layout.view,
                                     layout.splitter, layout.panel, layout.status})
        {
            EXPECT_GE(part.width, 0) << side;
            EXPECT_GE(part.height, 0) << side;
        }
    }
}

} // namespace cellwarp::core
