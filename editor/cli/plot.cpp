// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/plot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

namespace cellwarp::core
{

namespace
{

// Places in a plot [pixel at 100 %].
constexpr double kWidth = 760.0;
constexpr double kLeft = 74.0, kRight = 740.0, kTop = 40.0, kBottom = 372.0;
constexpr double kLegendTop = 436.0, kLegendStep = 21.0;
constexpr double kMarker = 4.0;
constexpr double kRoomOfLabel = 56.0; ///< beside a marker

/// Names in a legend up to so long stand three in a line, longer ones two.
constexpr std::size_t kLongName = 24;

/// Up to so many decades the 2 and the 5 are labelled as well.
constexpr double kFewDecades = 2.01;

std::string head(double height, const std::string& title)
{
    return fmt::format(
        "<svg viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" height=\"{1:g}\" role=\"img\" "
        "aria-label=\"{2}\" font-family=\"system-ui, 'Segoe UI', 'Noto Sans', "
        "sans-serif\" "
        "font-size=\"12\" fill=\"currentColor\">\n"
        "<text x=\"{3:g}\" y=\"20\" font-size=\"15\" font-weight=\"600\">{2}</text>\n",
        kWidth, height, in_markup(title), kLeft);
}

std::string line(double x0, double y0, double x1, double y1, double opacity)
{
    return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" "
                       "stroke=\"currentColor\" stroke-opacity=\"{:g}\"/>\n",
                       x0, y0, x1, y1, opacity);
}

enum class Anchor
{
    Start,
    Middle,
    End
};

/// \p markup is put in as it is.
std::string text(double x, double y, Anchor anchor, const std::string& markup,
                 const std::string& more = "")
{
    constexpr const char* names[] = {"start", "middle", "end"};
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n",
                       x, y, names[static_cast<int>(anchor)], more, markup);
}

/// A mark of a logarithmic axis: mantissa times 10^exponent.
struct Tick
{
    int mantissa = 1, exponent = 0;
    double value() const { return mantissa * std::pow(10.0, exponent); }
};

std::string tick_label(const Tick& tick)
{
    if (tick.exponent >= -2 && tick.exponent <= 3)
        return fmt::format("{:g}", tick.value());
    const std::string times = tick.mantissa == 1 ? "" : fmt::format("{}·", tick.mantissa);
    const std::string sign = tick.exponent < 0 ? "\u2212" : "";
    return fmt::format("{}10<tspan dy=\"-5\" font-size=\"9\">{}{}</tspan>", times, sign,
                       std::abs(tick.exponent));
}

/// A logarithmic axis from one tick of 1, 2 or 5 to another.
class LogAxis
{
public:
    LogAxis(double low, double high, double first, double last)
        : first_(first), last_(last)
    {
        low_ = border(low, true);
        high_ = border(high, false);
        if (!(high_ > low_ * 1.5))
        {
            low_ = border(low_ / 2.0, true);
            high_ = border(high_ * 2.0, false);
        }
    }

    double place(double value) const
    {
        return first_ +
               (last_ - first_) * std::log(value / low_) / std::log(high_ / low_);
    }
    bool is_labelled(const Tick& tick) const
    {
        const bool is_short = std::log10(high_ / low_) < kFewDecades;
        return tick.mantissa == 1 ||
               (is_short && (tick.mantissa == 2 || tick.mantissa == 5));
    }
    double low() const { return low_; }
    std::vector<Tick> ticks() const
    {
        constexpr double slack = 1.0 + 1e-9; // a border is a tick, rounding or not
        std::vector<Tick> found;
        for (int exponent = static_cast<int>(std::floor(std::log10(low_))) - 1;
             exponent <= static_cast<int>(std::ceil(std::log10(high_))); ++exponent)
            for (int mantissa = 1; mantissa <= 9; ++mantissa)
            {
                const Tick tick{mantissa, exponent};
                if (tick.value() * slack >= low_ && tick.value() <= high_ * slack)
                    found.push_back(tick);
            }
        return found;
    }

private:
    /// The next 1, 2 or 5 below or above.
    static double border(double value, bool is_below)
    {
        const double decade = std::pow(10.0, std::floor(std::log10(value)));
        constexpr double slack = 1.0 + 1e-9;
        double below = decade;
        for (const double mantissa : {2.0, 5.0, 10.0})
        {
            if (!is_below && mantissa * decade * slack >= value)
                return value <= below * slack ? below : mantissa * decade;
            if (is_below && mantissa * decade > value * slack)
                return below;
            below = mantissa * decade;
        }
        return below;
    }

    double low_ = 0.0, high_ = 0.0, first_, last_;
};

bool has_logarithm(const PlotPoint& point)
{
    return point.x > 0 && point.y > 0 && std::isfinite(point.x) && std::isfinite(point.y);
}

struct Range
{
    double low = INFINITY, high = 0.0;
    void add(double value)
    {
        low = std::min(low, value);
        high = std::max(high, value);
    }
};

std::string grid(const LogAxis& x, const LogAxis& y)
{
    std::string svg;
    for (const Tick& tick : x.ticks())
    {
        const double at = x.place(tick.value());
        svg += line(at, kTop, at, kBottom, tick.mantissa == 1 ? 0.22 : 0.07);
        if (x.is_labelled(tick))
            svg += text(at, kBottom + 18.0, Anchor::Middle, tick_label(tick));
    }
    for (const Tick& tick : y.ticks())
    {
        const double at = y.place(tick.value());
        svg += line(kLeft, at, kRight, at, tick.mantissa == 1 ? 0.22 : 0.07);
        if (y.is_labelled(tick))
            svg += text(kLeft - 8.0, at + 4.0, Anchor::End, tick_label(tick));
    }
    return svg + fmt::format("<rect x=\"{:g}\" y=\"{:g}\" width=\"{:g}\" height=\"{:g}\" "
                             "fill=\"none\" stroke=\"currentColor\" "
                             "stroke-opacity=\"0.55\"/>\n",
                             kLeft, kTop, kRight - kLeft, kBottom - kTop);
}

std::string marker(double x, double y, const PlotSeries& series, const std::string& tip,
                   bool is_below)
{
    const std::string inside =
        tip.empty() ? "" : fmt::format("<title>{}</title>", in_markup(tip));
    if (is_below)
        return fmt::format("<path d=\"M{:.1f} {:.1f}l{:g} {:g}h{:g}z\" fill=\"{}\">{}"
                           "</path>\n",
                           x, y, -kMarker - 1, -2 * kMarker, 2 * kMarker + 2,
                           series.colour, inside);
    if (series.marker == Marker::Square)
        return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:g}\" "
                           "height=\"{:g}\" fill=\"none\" pointer-events=\"all\" "
                           "stroke=\"{}\" stroke-width=\"2\">{}</rect>\n",
                           x - kMarker, y - kMarker, 2 * kMarker, 2 * kMarker,
                           series.colour, inside);
    return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:g}\" fill=\"{}\">{}"
                       "</circle>\n",
                       x, y, kMarker, series.colour, inside);
}

const char* dashes(const PlotSeries& series)
{
    return series.is_dashed ? " stroke-dasharray=\"6 4\"" : "";
}

std::string drawn(const PlotSeries& series, const LogAxis& x, const LogAxis& y,
                  double floor)
{
    std::string path, markers;
    for (const PlotPoint& point : series.points)
    {
        if (!has_logarithm(point))
            continue;
        const bool is_below = point.y < floor;
        const double px = x.place(point.x), py = y.place(std::max(point.y, floor));
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", px, py);
        markers += marker(px, py, series, point.tip, is_below);
    }
    return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\" "
                       "stroke-linejoin=\"round\"{}/>\n",
                       path, series.colour, dashes(series)) +
           markers;
}

/// Labels of points, those left out that would stand on another.
std::string labels(const LogPlot& plot, const LogAxis& x, const LogAxis& y)
{
    constexpr double kRoomAbove = 13.0;
    std::string svg;
    std::vector<std::array<double, 2>> taken;
    for (const PlotSeries& series : plot.series)
        for (const PlotPoint& point : series.points)
        {
            if (point.label.empty() || !has_logarithm(point))
                continue;
            const double px = x.place(point.x),
                         py = y.place(std::max(point.y, plot.y_floor));
            const bool is_free =
                std::none_of(taken.begin(), taken.end(),
                             [&](const std::array<double, 2>& other)
                             {
                                 return std::abs(other[0] - px) < kRoomOfLabel &&
                                        std::abs(other[1] - py) < kRoomAbove;
                             });
            if (!is_free)
                continue;
            taken.push_back({px, py});
            const bool is_at_edge = px > kRight - kRoomOfLabel;
            svg += text(px + (is_at_edge ? -8.0 : 8.0), py - 7.0,
                        is_at_edge ? Anchor::End : Anchor::Start, in_markup(point.label),
                        " font-size=\"11\"");
        }
    return svg;
}

std::size_t legend_columns(const std::vector<PlotSeries>& all)
{
    return std::any_of(all.begin(), all.end(),
                       [](const PlotSeries& series)
                       { return series.name.size() > kLongName; })
               ? 2
               : 3;
}

double log_height(const LogPlot& plot)
{
    const std::size_t columns = legend_columns(plot.series);
    const std::size_t lines = (plot.series.size() + columns - 1) / columns;
    return kLegendTop + kLegendStep * static_cast<double>(lines);
}

/// Below the plot.
std::string legend(const std::vector<PlotSeries>& all)
{
    const std::size_t columns = legend_columns(all);
    const double width = (kWidth - kLeft) / static_cast<double>(columns);
    std::string svg;
    for (std::size_t i = 0; i < all.size(); ++i)
    {
        const double left = kLeft + width * static_cast<double>(i % columns);
        const double at = kLegendTop + kLegendStep * static_cast<double>(i / columns);
        svg += fmt::format("<path d=\"M{:.1f} {:g}h30\" stroke=\"{}\" "
                           "stroke-width=\"2\"{}/>\n",
                           left, at, all[i].colour, dashes(all[i]));
        svg += marker(left + 15.0, at, all[i], "", false);
        svg += text(left + 38.0, at + 4.0, Anchor::Start, in_markup(all[i].name));
    }
    return svg;
}

std::string axis_labels(const LogPlot& plot)
{
    const double middle = 0.5 * (kTop + kBottom);
    return text(0.5 * (kLeft + kRight), kBottom + 42.0, Anchor::Middle,
                in_markup(plot.x_label)) +
           text(18.0, middle, Anchor::Middle, in_markup(plot.y_label),
                fmt::format(" transform=\"rotate(-90 18 {:g})\"", middle));
}

} // namespace

std::string in_markup(std::string_view text)
{
    std::string out;
    for (const char c : text)
        switch (c)
        {
        case '&':
            out += "&amp;";
            break;
        case '<':
            out += "&lt;";
            break;
        case '>':
            out += "&gt;";
            break;
        case '"':
            out += "&quot;";
            break;
        case '\'':
            out += "&#39;";
            break;
        default:
            out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
        }
    return out;
}

std::string svg_of(const LogPlot& plot)
{
    Range xs, ys;
    for (const PlotSeries& series : plot.series)
        for (const PlotPoint& point : series.points)
            if (has_logarithm(point))
            {
                xs.add(point.x);
                ys.add(std::max(point.y, plot.y_floor));
            }
    std::string svg = head(log_height(plot), plot.title);
    if (xs.high > 0)
    {
        const LogAxis x(xs.low, xs.high, kLeft, kRight);
        const LogAxis y(ys.low, ys.high, kBottom, kTop);
        svg += grid(x, y) + axis_labels(plot);
        for (const PlotSeries& series : plot.series)
            svg += drawn(series, x, y, plot.y_floor);
        svg += labels(plot, x, y) + legend(plot.series);
    }
    else
        svg += text(kLeft, kTop + 20.0, Anchor::Start, "nothing to draw");
    return svg + "</svg>\n";
}

} // namespace cellwarp::core
