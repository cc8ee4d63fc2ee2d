// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/holding_warnings.h"

#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "io/base/error.h"
#include "library/session/region_cells.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// The number of samples in each part.
std::vector<std::size_t> samples_of_parts(const CellSystem& system)
{
    std::vector<std::size_t> in_cell(system.body().cells.size(), 0);
    for (const int cell : system.body().cell_of_sample)
        ++in_cell[idx(cell)];
    std::vector<std::size_t> samples;
    for (const Component& part : system.components())
    {
        std::size_t& of_part = samples.emplace_back(0);
        for (const int cell : part.cells)
            of_part += in_cell[idx(cell)];
    }
    return samples;
}

Hold hold_of(const CellSystem& system, const Component& part)
{
    return system.constraints()[idx(part.cells.front())].hold;
}

/// Parts are numbered by their first samples. \p samples: of each part.
void warn_of_loose_parts(const CellSystem& system, std::span<const std::size_t> samples,
                         std::vector<std::string>& warnings)
{
    constexpr std::size_t kMostTold = 6;
    const std::vector<Component>& parts = system.components();
    std::vector<std::size_t> part_of_cell(system.body().cells.size());
    for (std::size_t k = 0; k < parts.size(); ++k)
        for (const int cell : parts[k].cells)
            part_of_cell[idx(cell)] = k;
    std::vector<int> number(parts.size(), -1);
    int count = 0;
    for (const int cell : system.body().cell_of_sample)
        if (int& of_part = number[part_of_cell[idx(cell)]]; of_part < 0)
            of_part = count++;
    std::vector<int> goes_with(parts.size(), -1); // number of a part with samples
    std::vector<std::pair<int, int>> told;
    std::size_t num_samples = 0;
    for (const BridgedComponent& one : system.loose().components())
    {
        const std::size_t own = idx(one.component), to = idx(one.to);
        goes_with[own] = number[to] >= 0 ? number[to] : goes_with[to];
        if (number[own] < 0)
            continue;
        told.emplace_back(number[own], goes_with[own]);
        num_samples += samples[own];
    }
    if (told.empty())
        return;
    std::sort(told.begin(), told.end());
    std::string pairs;
    for (std::size_t k = 0; k < std::min(kMostTold, told.size()); ++k)
        pairs += fmt::format("{}{} with {}", k == 0 ? "" : ", ", told[k].first,
                             told[k].second);
    warnings.push_back(fmt::format(
        "{} of {} parts have no region and go with the part nearest to them: {}{} ({} of "
        "{} samples; --loose stay keeps them at rest)",
        told.size(), count, pairs, told.size() > kMostTold ? ", ..." : "", num_samples,
        system.body().cell_of_sample.size()));
}

/// Warnings of parts without a region, and of those that may still turn.
std::vector<std::string> part_warnings(const CellSystem& system)
{
    std::vector<std::string> warnings;
    if (system.regions().size() == 0)
        return warnings; // nothing is asked of any
    const std::vector<Component>& parts = system.components();
    const std::vector<std::size_t> samples = samples_of_parts(system);
    std::size_t num_idle = 0, num_samples = 0;
    for (std::size_t k = 0; k < parts.size(); ++k)
        if (hold_of(system, parts[k]) == Hold::Idle)
        {
            ++num_idle;
            num_samples += samples[k];
        }
    // Bits of material without samples stay unseen.
    if (num_samples > 0)
        warnings.push_back(fmt::format(
            "{} of {} components have no region: they stay at rest ({} of "
            "{} samples)",
            num_idle, parts.size(), num_samples, system.body().cell_of_sample.size()));
    warn_of_loose_parts(system, samples, warnings);
    for (const Component& part : parts)
        if (part.free_rotations > 0)
            warnings.push_back(fmt::format(
                "a component of {} cells is held by {} alone: {} of its rotations are "
                "free and are kept as they are",
                part.cells.size(),
                part.free_rotations == 3 || system.rest().flat_axis >= 0
                    ? "one pin"
                    : "pins in a line",
                part.free_rotations));
    return warnings;
}

/// Regions whose stiffness differs by more than this get a warning.
constexpr double kExtremeContrast = 1e12;

std::vector<std::string> stiffness_warnings(const CellSystem& system)
{
    const std::vector<double> factors =
        cell_factors(system.regions(), system.shares(), system.body().cells.size());
    const auto [softest, stiffest] = std::minmax_element(factors.begin(), factors.end());
    if (factors.empty() || *stiffest <= kExtremeContrast * *softest)
        return {};
    return {fmt::format("stiffness differs by a factor of {:.1g}: the soft "
                        "parts keep few digits",
                        *stiffest / *softest)};
}

/// Of regions that hold too little, or too much, for anything to bend.
std::vector<std::string> warnings_of_too_little_or_too_much(const CellSystem& system,
                                                            const std::string& file)
{
    if (system.regions().skeleton())
        return {};
    std::vector<const Region*> holding;
    for (const Region& region : system.regions().regions())
        if (region.prescribes())
            holding.push_back(&region);
    if (holding.size() == 1 && holding[0]->role == Role::Handle)
        return {at({file, holding[0]->line, holding[0]->name},
                   "nothing else is held: all that hangs together with it moves along as "
                   "a whole")};
    const bool has_free_cells = std::any_of(
        system.constraints().begin(), system.constraints().end(),
        [](const Constraint& constraint)
        { return constraint.hold == Hold::Free || constraint.hold == Hold::Idle; });
    if (holding.size() > 1 && !has_free_cells)
        return {"the regions hold all cells: nothing between them is left to follow "
                "(smaller regions, or smaller cells by --across, leave something)"};
    return {};
}

/// Cells with samples or material of a region that hang together.
struct RegionPiece
{
    int cell = -1; ///< one of them
    std::size_t num_samples = 0;
    bool hangs_on_others = false; ///< is glued to a cell without either
};

std::vector<RegionPiece> pieces_of(const Region& region, const RegionShares& shares,
                                   const Body& body)
{
    std::map<int, std::size_t> samples_in; // of each of these cells
    for (const auto& [cell, share] : shares.cells)
        samples_in.try_emplace(cell, 0);
    for (const std::uint32_t i : region.samples)
        ++samples_in[body.cell_of_sample[i]];
    std::vector<RegionPiece> pieces;
    std::set<int> seen;
    for (const auto& [first, count] : samples_in)
    {
        if (!seen.insert(first).second)
            continue;
        RegionPiece piece{first};
        std::vector<int> cells{first};
        for (std::size_t k = 0; k < cells.size(); ++k)
        {
            piece.num_samples += samples_in.at(cells[k]);
            for (const int next : body.cells.neighbours_of(cells[k]))
                if (!samples_in.contains(next))
                    piece.hangs_on_others = true;
                else if (seen.insert(next).second)
                    cells.push_back(next);
        }
        pieces.push_back(piece);
    }
    return pieces;
}

/// Pieces of a handle that are apart from the rest of it and have less of its samples
/// than this share are hardly meant: a box around a limb easily has a bit of the body in
/// it, which is pulled out then. Where such pieces are all that there is, they are.
constexpr double kSmallPiece = 0.05;

/// Such pieces of a region, the largest first, unless together they are more.
std::vector<RegionPiece> stray_pieces(const CellSystem& system, std::size_t region)
{
    const Region& whole = system.regions()[region];
    const double most = kSmallPiece * static_cast<double>(whole.samples.size());
    std::vector<RegionPiece> pieces =
        pieces_of(whole, system.shares()[region], system.body());
    std::erase_if(pieces,
                  [&](const RegionPiece& piece)
                  {
                      return piece.num_samples == 0 || !piece.hangs_on_others ||
                             static_cast<double>(piece.num_samples) >= most;
                  });
    std::size_t all = 0;
    for (const RegionPiece& piece : pieces)
        all += piece.num_samples;
    if (static_cast<double>(all) >= most)
        return {};
    std::sort(pieces.begin(), pieces.end(),
              [](const RegionPiece& a, const RegionPiece& b)
              { return a.num_samples > b.num_samples; });
    return pieces;
}

std::vector<std::string> piece_warnings(const CellSystem& system, const std::string& file)
{
    std::vector<std::string> warnings;
    for (std::size_t r = 0; r < system.regions().size(); ++r)
    {
        const Region& region = system.regions()[r];
        // What is listed one by one is meant.
        if (region.role != Role::Handle || region.spline || !region.listed.empty())
            continue;
        const std::vector<RegionPiece> stray = stray_pieces(system, r);
        if (stray.empty())
            continue;
        std::size_t num_samples = 0;
        for (const RegionPiece& piece : stray)
            num_samples += piece.num_samples;
        const Eigen::Vector3d x = system.rest().frame.to_model(
            system.body().cells.cells[idx(stray.front().cell)].anchor);
        warnings.push_back(at(
            {file, region.line, region.name},
            fmt::format(
                "{} of its {} samples are apart from the others, in {} near {:.7g} "
                "{:.7g} {:.7g}: they are pulled along (a smaller selection leaves them "
                "out)",
                num_samples, region.samples.size(),
                stray.size() == 1 ? "a piece"
                                  : fmt::format("{} pieces, one", stray.size()),
                x.x(), x.y(), x.z())));
    }
    return warnings;
}

/// Warnings of rods that have fewer spans than their statements ask for.
std::vector<std::string> span_warnings(const CellSystem& system, const std::string& file)
{
    std::vector<std::string> warnings;
    for (const Region& region : system.regions().regions())
        if (region.told && region.told->spans > region.spans &&
            region.told->spans != SplineStatement().spans)
            warnings.push_back(
                at({file, region.line, region.name},
                   fmt::format("spans: {} in each gap instead of {}: with stiffness none "
                               "is shorter than a cell (more --across allows more)",
                               region.spans, region.told->spans)));
    return warnings;
}

} // namespace

PartsByHold parts_by_hold(const CellSystem& system)
{
    PartsByHold counts;
    const std::vector<std::size_t> samples = samples_of_parts(system);
    for (std::size_t k = 0; k < samples.size(); ++k)
    {
        const Component& part = system.components()[k];
        std::size_t& of = part.is_held                               ? counts.held
                          : hold_of(system, part) == Hold::Following ? counts.follow
                                                                     : counts.stay;
        of += samples[k] > 0;
    }
    return counts;
}

std::vector<std::string> holding_warnings(const CellSystem& system,
                                          const std::string& file)
{
    std::vector<std::string> warnings = stiffness_warnings(system);
    for (const auto& more :
         {part_warnings(system), warnings_of_too_little_or_too_much(system, file),
          piece_warnings(system, file), span_warnings(system, file)})
        warnings.insert(warnings.end(), more.begin(), more.end());
    return warnings;
}

} // namespace cellwarp::core
