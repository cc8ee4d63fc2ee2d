// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/colours.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Gaps below this are not told apart: they cannot be seen [diagonal].
constexpr float kSmallestGap = 1e-6f;
constexpr std::uint8_t kMarked = 255, kMarkedInRegion = 110;

float value_of(const ShownCell& cell, CellColours by)
{
    return by == CellColours::Depth ? static_cast<float>(cell.depth)
                                    : std::max(cell.gap, kSmallestGap);
}

Colour unmarked(const PlainColour& colour)
{
    return {colour[0], colour[1], colour[2], 0};
}

} // namespace

Colour colour_of(Role role)
{
    return unmarked(role_colour(role));
}

Colour free_colour()
{
    return unmarked(kFreeColour);
}
Colour selected_colour()
{
    return {244, 122, 44, 255};
}

std::vector<Colour> sample_colours(const Document& document, const Selection& selection,
                                   const ShapeLayout& layout, bool shows_regions)
{
    std::vector<Colour> colours(layout.order.size(), free_colour());
    const std::vector<EditedRegion>& regions = document.regions();
    // Backwards: of two that hold a sample the first declared is seen.
    if (shows_regions)
        for (std::size_t r = regions.size(); r-- > 0;)
        {
            const Colour colour = colour_of(regions[r].role);
            for (const std::uint32_t sample : regions[r].samples)
                colours[layout.place_of[sample]] = colour;
        }
    for (const SampleRun& run : selection.runs())
        for (std::int64_t sample = run.first; sample <= run.second; ++sample)
        {
            Colour& colour = colours[layout.place_of[idx(sample)]];
            colour[3] = colour == free_colour() ? kMarked : kMarkedInRegion;
        }
    return colours;
}

CellScale cell_scale(const ShownCells& cells, CellColours by)
{
    if (cells.cells.empty() || by == CellColours::Region)
        return {};
    CellScale scale{value_of(cells.cells[0], by), value_of(cells.cells[0], by),
                    by == CellColours::Gap};
    for (const ShownCell& cell : cells.cells)
    {
        scale.low = std::min(scale.low, value_of(cell, by));
        scale.high = std::max(scale.high, value_of(cell, by));
    }
    if (by == CellColours::Gap) // at most three powers of ten
        scale.low = std::max(scale.low, scale.high * 1e-3f);
    return scale;
}

Colour cell_colour(const ShownCell& cell, CellColours by, const CellScale& scale,
                   std::span<const EditedRegion> regions)
{
    if (by == CellColours::Region)
        return cell.region >= 0 && idx(cell.region) < regions.size()
                   ? colour_of(regions[idx(cell.region)].role)
                   : free_colour();
    if (!(scale.high > scale.low))
        return scale_colour(0.0);
    const float value = value_of(cell, by);
    return scale_colour(scale.is_logarithmic
                            ? std::log(value / scale.low) /
                                  std::log(scale.high / scale.low)
                            : (value - scale.low) / (scale.high - scale.low));
}

Colour scale_colour(double t)
{
    // Deep blue, teal, yellow, red: the order can be told without their names.
    constexpr std::array<std::array<double, 3>, 5> kStops = {
        {{58, 82, 160}, {52, 142, 172}, {110, 184, 120}, {240, 200, 80}, {222, 84, 56}}};
    const double at =
        std::clamp(t == t ? t : 0.0, 0.0, 1.0) * static_cast<double>(kStops.size() - 1);
    const std::size_t stop = std::min(static_cast<std::size_t>(at), kStops.size() - 2);
    const double share = at - static_cast<double>(stop);
    Colour colour{};
    for (std::size_t c = 0; c < 3; ++c)
        colour[c] = static_cast<std::uint8_t>(
            std::lround(kStops[stop][c] * (1.0 - share) + kStops[stop + 1][c] * share));
    return colour;
}

} // namespace cellwarp::core
