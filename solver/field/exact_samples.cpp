// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/exact_samples.h"

#include <array>
#include <map>

#include "octree/base/index.h"
#include "solver/field/region_points.h"

namespace cellwarp::core
{

namespace
{

using RegionOfPlace = std::map<std::array<double, 3>, int>;

/// Places of samples that lie so near to cells of another region that they may be points
/// of these, and the regions of the samples.
RegionOfPlace samples_near_other_regions(std::span<const ExactSamples> regions,
                                         const Cells& cells,
                                         std::span<const int> region_of_cell,
                                         std::span<const Eigen::Vector3d> samples,
                                         std::span<const int> cell_of_sample)
{
    constexpr int kNoRegion = -1, kSeveral = -2;
    // The region of cells nearby.
    std::vector<int> near(region_of_cell.begin(), region_of_cell.end());
    const auto meet = [](int& one, int other)
    {
        if (other != kNoRegion && one != other)
            one = one == kNoRegion ? other : kSeveral;
    };
    // From a cell to another one at its corner it is three steps through faces.
    for (int step = 0; step < 3; ++step)
    {
        std::vector<int> next = near;
        for (std::size_t c = 0; c < near.size(); ++c)
            for (const int other : cells.neighbours_of(static_cast<int>(c)))
                meet(next[c], near[idx(other)]);
        near = std::move(next);
    }
    RegionOfPlace places;
    for (std::size_t r = 0; r < regions.size(); ++r)
        for (const std::uint32_t i : regions[r].samples)
        {
            const int other = near[idx(cell_of_sample[i])];
            const Eigen::Vector3d& x = samples[i];
            if (other != kNoRegion && other != static_cast<int>(r))
                places.try_emplace({x.x(), x.y(), x.z()}, static_cast<int>(r));
        }
    return places;
}

} // namespace

std::vector<std::optional<RegionFade>>
fades_of(std::span<const ExactSamples> regions, const Cells& cells,
         std::span<const Constraint> constraints, std::span<const int> region_of_cell,
         std::span<const Eigen::Vector3d> places, std::span<const int> cell_of_sample)
{
    const RegionPoints points(cells, constraints);
    const RegionOfPlace taken_places = samples_near_other_regions(
        regions, cells, region_of_cell, places, cell_of_sample);
    const auto is_sample_of_another = [&](const Eigen::Vector3d& x, std::size_t region)
    {
        const auto found = taken_places.find({x.x(), x.y(), x.z()});
        return found != taken_places.end() && found->second != static_cast<int>(region);
    };
    // A sample of a rod and of another region is the other one's; of two rods the
    // first's.
    std::vector<bool> is_taken(places.size(), false);
    for (const ExactSamples& region : regions)
        if (region.is_rigid)
            for (const std::uint32_t i : region.samples)
                is_taken[i] = true;
    std::vector<std::optional<RegionFade>> fades(regions.size());
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        std::vector<RegionFade::Node> samples, further;
        for (const std::uint32_t i : regions[r].samples)
            if (regions[r].is_rigid || !is_taken[i])
                samples.push_back({places[i], cell_of_sample[i]});
        if (samples.empty())
            continue;
        for (const std::uint32_t i : regions[r].samples)
            is_taken[i] = true;
        for (std::size_t c = 0; c < constraints.size(); ++c)
            if (region_of_cell[c] == static_cast<int>(r) && regions[r].is_rigid &&
                constraints[c].is_of_rigid_region())
                for (const RegionPoints::Point& point : points.of(c))
                    if (point.is_at_border && !is_sample_of_another(point.at, r))
                        further.push_back({point.at, static_cast<int>(c)});
        fades[r].emplace(cells, samples, further);
    }
    return fades;
}

} // namespace cellwarp::core
