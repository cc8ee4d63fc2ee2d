// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/picture/axes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

constexpr std::array<std::uint8_t, 3> kAxisInk = {70, 74, 82}, kRim = {255, 255, 255};

/// An axis is drawn where its edge is at least so long [height of a line].
constexpr double kShortest = 2.5;

/// Of the lines at numbers, and from there to the middle of a number [height of a line].
constexpr double kTick = 0.4, kToNumber = 1.5, kToName = 3.4;

/// About so many numbers an axis.
constexpr double kNumbers = 5.0;

/// A line of one pixel, smoothed.
void draw_line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, int first, int end,
               Image& image)
{
    const Eigen::Vector2d way = to - from;
    const int steps = std::max(1, static_cast<int>(std::ceil(way.cwiseAbs().maxCoeff())));
    const int across = std::abs(way.x()) >= std::abs(way.y()) ? 1 : 0;
    for (int s = 0; s <= steps; ++s)
    {
        // Two pixels side by side share what the line covers.
        Eigen::Vector2d x = from + way * (static_cast<double>(s) / steps);
        x.array() -= 0.5;
        const double low = std::floor(x[across]);
        for (const int side : {0, 1})
        {
            const double cover = side ? x[across] - low : 1.0 - (x[across] - low);
            Eigen::Vector2d place = x;
            place[across] = low + side;
            const int column = first + static_cast<int>(std::lround(place.x()));
            const int row = static_cast<int>(std::lround(place.y()));
            if (column >= first && column < end)
                cover_pixel(image, column, row, kAxisInk, cover);
        }
    }
}

/// The ends of the edge of an axis that is outermost.
std::array<Eigen::Vector3d, 2> outer_edge(const Eigen::AlignedBox3d& box, int axis,
                                          bool is_upright, const Projection& projection)
{
    std::array<Eigen::Vector3d, 2> outermost;
    double most = 0.0;
    for (int k = 0; k < 4; ++k)
    {
        std::array<Eigen::Vector3d, 2> ends = {box.min(), box.min()};
        for (Eigen::Vector3d& end : ends)
            for (int side = 0; side < 2; ++side)
                if (k >> side & 1)
                {
                    const int other = (axis + 1 + side) % 3;
                    end[other] = box.max()[other];
                }
        ends[1][axis] = box.max()[axis];
        const Eigen::Vector2d middle = projection.at(0.5 * (ends[0] + ends[1]));
        const double outside = is_upright ? -middle.x() : middle.y();
        if (k == 0 || outside > most + 1e-9 * std::abs(most))
        {
            most = outside;
            outermost = ends;
        }
    }
    return outermost;
}

} // namespace

std::vector<double> ticks_between(double low, double high)
{
    std::vector<double> ticks;
    if (!(high > low))
        return ticks;
    const double wanted = (high - low) / kNumbers;
    const double power = std::pow(10.0, std::floor(std::log10(wanted)));
    const double share = wanted / power;
    double step = 10.0 * power;
    // Half way to the next one, by their ratio.
    for (const auto& [round, up_to] :
         {std::pair(5.0, std::sqrt(50.0)), {2.0, std::sqrt(10.0)}, {1.0, std::sqrt(2.0)}})
        if (share < up_to)
            step = round * power;
    const double slack = 1e-9 * (high - low);
    for (double k = std::ceil((low - slack) / step); k * step <= high + slack; ++k)
        ticks.push_back(k * step + 0.0); // no -0
    return ticks;
}

void draw_axes(const Eigen::AlignedBox3d& box, int up_axis, const Projection& projection,
               const Lettering& lettering, int first_column, Image& image)
{
    const double line = lettering.height();
    const Eigen::Vector2d middle = projection.at(box.center());
    const int end = first_column + projection.width;
    for (int axis = 0; axis < 3; ++axis)
    {
        const auto [from, to] = outer_edge(box, axis, axis == up_axis, projection);
        const Eigen::Vector2d a = projection.at(from), b = projection.at(to);
        const double length = (b - a).norm();
        if (length < kShortest * line)
            continue;
        draw_line(a, b, first_column, end, image);
        const Eigen::Vector2d along = (b - a) / length;
        Eigen::Vector2d out(along.y(), -along.x());
        if (out.dot(0.5 * (a + b) - middle) < 0)
            out = -out;
        const auto write =
            [&](const std::string& text, const Eigen::Vector2d& place, double away)
        {
            const Eigen::Vector2d x = place + away * line * out;
            // A light rim, for what is dark behind.
            for (const auto& [side, down] : {std::pair(-1, 0), {1, 0}, {0, -1}, {0, 1}})
                lettering.draw(text, first_column + x.x() + side, x.y() + down, kRim,
                               image);
            lettering.draw(text, first_column + x.x(), x.y(), kAxisInk, image);
        };
        const std::vector<double> ticks = ticks_between(box.min()[axis], box.max()[axis]);
        for (std::size_t k = 0; k < ticks.size(); ++k)
        {
            const Eigen::Vector2d place =
                a + (b - a) * ((ticks[k] - from[axis]) / (to[axis] - from[axis]));
            draw_line(place, place + kTick * line * out, first_column, end, image);
            // Where numbers would stand too close every second is left out.
            const double apart = length / static_cast<double>(ticks.size());
            if (apart > kShortest * line || k % 2 == 0)
                write(fmt::format("{:.6g}", ticks[k]), place, kToNumber);
        }
        write(std::string(1, static_cast<char>('x' + axis)), 0.5 * (a + b), kToName);
    }
}

} // namespace cellwarp::core
