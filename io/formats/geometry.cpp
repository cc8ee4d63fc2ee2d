// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/geometry.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/base/error.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

/// Largest coordinate: beyond it squares overflow.
constexpr double kMaxCoordinate = 1e150;

std::string element(const char* list, std::size_t i)
{
    return std::string(list) + "[" + std::to_string(i) + "]";
}

template <class Vector>
void check_finite(const char* list, const std::vector<Vector>& vectors)
{
    for (std::size_t i = 0; i < vectors.size(); ++i)
        for (Eigen::Index k = 0; k < vectors[i].size(); ++k)
            if (!std::isfinite(vectors[i][k]))
                throw malformed({"", 0, element(list, i) + "[" + std::to_string(k) + "]"},
                                "got " + shortest(vectors[i][k]) +
                                    ", need a finite number");
}

void check_index(const std::string& field, std::uint32_t index, std::size_t count)
{
    if (index >= count)
        throw malformed({"", 0, field}, "got " + std::to_string(index) + ", there are " +
                                            std::to_string(count) + " samples");
}

void check_faces(const Geometry& geometry)
{
    constexpr std::uint64_t kFewest = 3; // corners
    std::uint64_t begin = 0;
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::uint64_t end = geometry.face_ends[f];
        if (end < begin + kFewest || end > geometry.corners.size())
            throw malformed({"", 0, element("faces", f)},
                            "its corners begin at " + std::to_string(begin) +
                                " and end at " + std::to_string(end) + " of " +
                                std::to_string(geometry.corners.size()) +
                                ", need three or more");
        for (std::uint64_t c = begin; c < end; ++c)
            if (geometry.corners[c] >= geometry.samples.size())
                check_index(element("faces", f) + "[" + std::to_string(c - begin) + "]",
                            geometry.corners[c], geometry.samples.size());
        begin = end;
    }
    if (begin != geometry.corners.size())
        throw malformed({"", 0, "faces"}, "the last one ends at corner " +
                                              std::to_string(begin) + " of " +
                                              std::to_string(geometry.corners.size()));
}

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

void check_geometry(const Geometry& geometry)
{
    if (geometry.samples.empty())
        throw malformed({"", 0, "samples"}, "there is none");
    check_finite("samples", geometry.samples);
    for (std::size_t i = 0; i < geometry.samples.size(); ++i)
        if (!(geometry.samples[i].cwiseAbs().maxCoeff() <= kMaxCoordinate))
            throw malformed({"", 0, element("samples", i)}, "is beyond 1e150");
    check_faces(geometry);
    for (std::size_t i = 0; i < geometry.lines.size(); ++i)
        for (std::size_t k = 0; k < 2; ++k)
            check_index(element("lines", i) + "[" + std::to_string(k) + "]",
                        geometry.lines[i][k], geometry.samples.size());
    check_finite("normals", geometry.directions);
    check_finite("tangents", geometry.tangents);
    check_finite("rotations", geometry.rotations);
    for (std::size_t i = 0; i < geometry.rotations.size(); ++i)
        if (const double length = geometry.rotations[i].stableNorm(); !(length > 0.0))
            throw malformed({"", 0, element("rotations", i)}, "has no length");
}

} // namespace cellwarp::core
