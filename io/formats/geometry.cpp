// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/geometry.h"

#include <algorithm>
#include <utility>

#include "io/base/error.h"

namespace cellwarp::core
{

namespace
{

/// Largest coordinate: beyond it squares overflow.
constexpr double kMaxCoordinate = 1e150;

} // namespace

std::vector<DirectionUse> direction_uses(const Geometry& geometry)
{
    std::vector<DirectionUse> uses;
    if (geometry.format == "stl")
        return uses; // its normals follow from its corners
    for (std::size_t i = 0; i < geometry.direction_samples.size(); ++i)
        uses.push_back({static_cast<std::uint32_t>(i), geometry.direction_samples[i]});
    for (std::size_t c = 0; c < geometry.corner_directions.size(); ++c)
        if (geometry.corner_directions[c] != kNone)
            uses.push_back({geometry.corner_directions[c], geometry.corners[c]});
    const auto key = [](const DirectionUse& use)
    { return std::pair(use.direction, use.sample); };
    std::sort(uses.begin(), uses.end(),
              [&](const DirectionUse& a, const DirectionUse& b)
              { return key(a) < key(b); });
    uses.erase(std::unique(uses.begin(), uses.end(),
                           [&](const DirectionUse& a, const DirectionUse& b)
                           { return key(a) == key(b); }),
               uses.end());
    return uses;
}

void check_magnitude(const std::string& path, const Geometry& geometry)
{
    const ByteOffsets& places = geometry.sample_places;
    const bool has_places = !places.records.empty() || !places.starts.empty();
    for (std::size_t i = 0; i < geometry.samples.size(); ++i)
        if (!(geometry.samples[i].cwiseAbs().maxCoeff() <= kMaxCoordinate))
            throw malformed(
                {path, 0,
                 "sample " + std::to_string(geometry.samples_before + i) +
                     (has_places ? " (byte " + std::to_string(places.start(3 * i)) + ")"
                                 : "")},
                "is beyond 1e150");
}

} // namespace cellwarp::core
