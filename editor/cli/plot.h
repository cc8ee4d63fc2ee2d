// SPDX-License-Identifier: GPL-3.0-or-later
// Plots as SVG for a page: lines over two logarithmic axes. They take the colour of the
// text around them, so they are right on dark pages and on paper.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cellwarp::core
{

/// Text as it may stand in a page or a plot, also within quotes.
std::string in_markup(std::string_view text);

enum class Marker
{
    Disc,
    Square ///< hollow
};

struct PlotPoint
{
    double x = 0.0, y = 0.0;
    std::string label; ///< beside the marker; may be empty
    std::string tip;   ///< shown under the pointer
};

struct PlotSeries
{
    std::string name;
    std::string colour; ///< "#rrggbb"
    bool is_dashed = false;
    Marker marker = Marker::Disc;
    std::vector<PlotPoint> points; ///< joined in this order
};

struct LogPlot
{
    std::string title, x_label, y_label;
    std::vector<PlotSeries> series;
    /// Smaller values of y are drawn at the lower border, as triangles; 0: none are.
    double y_floor = 0.0;
};

/// Points that no logarithm has (zero, negative, not finite) are left out.
std::string svg_of(const LogPlot& plot);

} // namespace cellwarp::core
