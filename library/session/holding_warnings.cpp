// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/holding_warnings.h"

#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "io/base/error.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

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

std::vector<std::string> holding_warnings(const CellSystem& system,
                                          const std::string& file)
{
    std::vector<std::string> warnings = warnings_of_too_little_or_too_much(system, file);
    for (const auto& more : {piece_warnings(system, file), span_warnings(system, file)})
        warnings.insert(warnings.end(), more.begin(), more.end());
    return warnings;
}

} // namespace cellwarp::core
