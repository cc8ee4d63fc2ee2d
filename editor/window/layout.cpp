// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/layout.h"

#include <algorithm>
#include <cmath>

namespace cellwarp::core
{

namespace
{

// Widths and heights [letters].
constexpr double kUsualPanel = 36.0;
constexpr double kNarrowestPanel = 18.0;
constexpr double kNarrowestView = 18.0;
constexpr double kOptions = 4.4, kStatus = 3.2, kSplitter = 0.7;
/// Part of a small window that the panel has at first.
constexpr double kMostOfWindow = 0.42;
/// The columns of tools on a low window.
constexpr int kMostColumns = 4;

int rounded_down(double pixels)
{
    return std::max(0, static_cast<int>(std::floor(pixels)));
}

} // namespace

Layout lay_out(const LayoutSizes& sizes, const PanelWish& wish)
{
    const double letter = static_cast<double>(sizes.letter);
    const int top = rounded_down(static_cast<double>(sizes.menu));
    const int below = std::max(top, sizes.height - rounded_down(kStatus * letter));
    Layout layout;
    layout.status = {0, below, sizes.width, std::max(0, sizes.height - below)};
    if (sizes.num_tools == 0)
    {
        layout.view = {0, top, sizes.width, below - top};
        return layout;
    }
    const double gap = static_cast<double>(kToolGap) * letter;
    const auto height_of = [&](int rows, double button)
    { return rows * (button * letter + gap) + 2 * gap; };
    const auto named = static_cast<double>(kToolHeight);
    const auto plain = static_cast<double>(kToolSide);
    layout.shows_names = height_of(sizes.num_tools, named) <= below - top;
    const auto rows = [&]
    { return (sizes.num_tools + layout.num_columns - 1) / layout.num_columns; };
    while (!layout.shows_names && layout.num_columns < kMostColumns &&
           height_of(rows(), plain) > below - top)
        ++layout.num_columns;
    const double side = layout.shows_names ? named : plain;
    const int left = std::min(
        sizes.width, rounded_down(layout.num_columns * (side * letter + gap) + gap));
    layout.tools = {0, top, left, below - top};

    const int splitter = rounded_down(std::max(4.0, kSplitter * letter));
    const double room = sizes.width - left - splitter;
    double panel = 0.0;
    if (wish.is_shown)
    {
        const double wanted =
            wish.width > 0.0
                ? wish.width * letter
                : std::min(kUsualPanel * letter, std::max(kMostOfWindow * sizes.width,
                                                          kNarrowestPanel * letter));
        panel = std::min(wanted, std::max(room - kNarrowestView * letter, 0.5 * room));
    }
    const int right = std::max(left, sizes.width - splitter - rounded_down(panel));
    layout.splitter = {right, top, std::min(splitter, sizes.width - right), below - top};
    const int panel_left = right + layout.splitter.width;
    layout.panel = {panel_left, top, sizes.width - panel_left, below - top};
    const int options = std::min(rounded_down(kOptions * letter), below - top);
    layout.options = {left, top, right - left, options};
    layout.view = {left, top + options, right - left, below - top - options};
    return layout;
}

PanelWish wish_at(double x, const LayoutSizes& sizes)
{
    const double letter = static_cast<double>(sizes.letter);
    const double width = (sizes.width - x) / letter;
    if (width < 0.5 * kNarrowestPanel)
        return {false, 0.0};
    return {true, std::max(width, kNarrowestPanel)};
}

} // namespace cellwarp::core
