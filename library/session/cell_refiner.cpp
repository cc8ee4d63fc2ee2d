// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/cell_refiner.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "library/session/region_cells.h"
#include "octree/base/index.h"
#include "solver/cells/refinement.h"

namespace cellwarp::core
{

namespace
{

/// Siblings merge when their errors are below this share of the threshold. Errors fall to
/// a half or a quarter from level to level, so that of their parent is then at most half
/// of it: it will not be split again for the same reason.
constexpr double kMerge = 0.125;

/// An error falls to about a quarter from level to level: a leaf whose error is larger
/// than this many thresholds is split twice at once.
constexpr double kSplitTwice = 4.0;

/// A round that splits no more than this share of the leaves also splits those whose
/// error is nearly the threshold: each round shifts the strain a little, and they would
/// follow in rounds of their own, each of which makes all equations anew.
constexpr double kFewSplit = 0.1, kNearlyOver = 0.8;

/// A round is not worth it where it would add no more than this share of the leaves that
/// earlier rounds have added, and no error is larger than this many thresholds: beside
/// smaller cells errors are somewhat larger, and such rounds follow one another through
/// the whole body.
constexpr double kHardlyAny = 0.02, kHardlyOver = 2.5;

/// Errors are relative to this share of the diagonal of what a shape has become, once it
/// is more than that at rest.
constexpr double kStretched = 0.5;

/// How many of the leaves that it may split partly_split() does split at a time. Folds
/// are narrow. With half or twice as many the armadillo's shoulder takes
/// more iterations.
constexpr double kPartlySplit = 0.06;

/// Cells that are few enough to begin in.
constexpr std::size_t kFewCells = 1500;

/// Steps of two regions that differ by no more are one [work].
constexpr double kSameTurns = 1e-12;

void sort_worst_first(std::vector<LeafNumber>& leaves, std::span<const double> errors)
{
    std::stable_sort(leaves.begin(), leaves.end(),
                     [&](LeafNumber a, LeafNumber b)
                     { return errors[idx(a)] > errors[idx(b)]; });
}

bool agree(const Motion& a, const Motion& b)
{
    return (a.R - b.R).norm() <= kSameTurns && (a.t - b.t).norm() <= kSameTurns;
}

} // namespace

CellRefiner::CellRefiner(std::shared_ptr<const RestShape> rest,
                         std::shared_ptr<const RegionSet> regions,
                         const CellSettings& settings,
                         const CellSystemSettings& system_settings)
    : rest_(std::move(rest)), regions_(std::move(regions)), settings_(settings),
      system_settings_(system_settings),
      has_material_(material_test(rest_->material.grid))
{
}

bool CellRefiner::is_adaptive() const
{
    return settings_.max_depth > settings_.min_depth &&
           std::isfinite(settings_.threshold);
}

CellSystem CellRefiner::first()
{
    auto body = std::make_shared<const Body>(build_body(rest_, settings_));
    warnings_.insert(warnings_.end(), body->warnings.begin(), body->warnings.end());
    if (is_adaptive())
        body = with_homes(std::move(body));
    coarsest_ = body->octree;
    return {std::move(body), regions_, system_settings_};
}

std::vector<LeafNumber>
CellRefiner::crowded_leaves(const Body& body, std::span<const RegionShares> shares) const
{
    std::vector<LeafNumber> leaves;
    for (const int cell : crowded_cells(*regions_, shares, body.cells))
    {
        const LeafNumber leaf = body.cells.cells[idx(cell)].leaf;
        if (body.octree[leaf].level < settings_.max_depth)
            leaves.push_back(leaf);
    }
    return leaves;
}

/// Splits further where a region would be left without a cell.
std::shared_ptr<const Body> CellRefiner::with_homes(std::shared_ptr<const Body> body)
{
    for (;;)
    {
        std::shared_ptr<const Body> next =
            finer_body(body, crowded_leaves(*body, regions_->shares(*body)));
        if (next == body)
            return body;
        body = std::move(next);
    }
}

/// Splits leaves of an octree, and of the first \p num_twice the parts as well.
Octree CellRefiner::split_twice(const Octree& octree, std::span<const LeafNumber> leaves,
                                std::size_t num_twice) const
{
    Octree once = octree.split(leaves, has_material_);
    if (num_twice == 0)
        return once;
    std::vector<bool> is_twice(octree.leaves().size(), false);
    for (const LeafNumber leaf : leaves.first(num_twice))
        is_twice[idx(leaf)] = octree[leaf].level + 1 < settings_.max_depth;
    std::vector<LeafNumber> parts;
    for (const LeafNumber part : once.numbers())
    {
        const LeafNumber whole = octree.find(once[part].corner);
        if (is_twice[idx(whole)] && once[part].level == octree[whole].level + 1)
            parts.push_back(part);
    }
    return once.split(parts, has_material_);
}

/// Splits a worst-first list of leaves, the first \p num_twice of them twice; where that
/// makes more than \p most leaves, as many as leave no more, once.
Octree CellRefiner::split(const Octree& octree, std::span<const LeafNumber> worst_first,
                          std::size_t num_twice, std::int64_t most) const
{
    const auto first_of = [&](std::size_t count)
    { return octree.split(worst_first.first(count), has_material_); };
    const auto fits = [&](const Octree& tree)
    { return static_cast<std::int64_t>(tree.leaves().size()) <= most; };
    Octree all = split_twice(octree, worst_first, num_twice);
    if (fits(all))
        return all;
    std::size_t few = 0, many = worst_first.size();
    Octree best = octree;
    while (many - few > 1)
    {
        const std::size_t middle = (few + many) / 2;
        Octree tree = first_of(middle);
        if (fits(tree))
        {
            few = middle;
            best = std::move(tree);
        }
        else
            many = middle;
    }
    return best;
}

/// Splits as many leaves of a worst-first list as max_cells allows, the first
/// \p num_twice of them twice. An empty list: the body itself.
std::shared_ptr<const Body>
CellRefiner::finer_body(const std::shared_ptr<const Body>& body,
                        std::span<const LeafNumber> worst_first, std::size_t num_twice)
{
    if (worst_first.empty())
        return body;
    // A leaf may hold several cells: what is too much is taken off the leaves.
    for (std::int64_t most = settings_.max_cells;;)
    {
        Octree octree = split(body->octree, worst_first, num_twice, most);
        const bool is_changed = octree.leaves() != body->octree.leaves();
        std::shared_ptr<const Body> next = body;
        if (is_changed)
            next =
                std::make_shared<const Body>(cut(rest_, std::move(octree), body.get()));
        const std::int64_t over =
            static_cast<std::int64_t>(next->cells.size()) - settings_.max_cells;
        if (is_changed && over > 0)
        {
            most -= over;
            continue;
        }
        if (!splits_all(*body, worst_first, *next))
            warn_of_budget(*next);
        return next;
    }
}

/// Whether none of these leaves of \p body is one of \p next still.
bool CellRefiner::splits_all(const Body& body, std::span<const LeafNumber> leaves,
                             const Body& next) const
{
    return std::none_of(leaves.begin(), leaves.end(),
                        [&](LeafNumber leaf)
                        {
                            const Leaf& one = body.octree[leaf];
                            const LeafNumber now = next.octree.find(one.corner);
                            return now != LeafNumber::None && next.octree[now] == one;
                        });
}

void CellRefiner::warn_of_budget(const Body& body)
{
    if (!is_over_budget_)
        warnings_.push_back(fmt::format(
            "refinement stopped at {} cells (max_cells {}): the worst were split first",
            body.cells.size(), settings_.max_cells));
    is_over_budget_ = true;
}

/// Of each leaf the regions with material in it, one of each motion.
std::vector<std::vector<int>>
CellRefiner::differing_regions(const Body& body, std::span<const RegionShares> shares,
                               std::span<const Motion> motions) const
{
    std::vector<std::vector<int>> regions(body.octree.leaves().size());
    for (std::size_t r = 0; r < regions_->size(); ++r)
    {
        if (!(*regions_)[r].moves_as_one())
            continue;
        for (const auto& [cell, share] : shares[r].cells)
        {
            std::vector<int>& of_leaf = regions[idx(body.cells.cells[idx(cell)].leaf)];
            if (std::none_of(of_leaf.begin(), of_leaf.end(),
                             [&](int other)
                             { return agree(motions[idx(other)], motions[r]); }))
                of_leaf.push_back(static_cast<int>(r));
        }
    }
    return regions;
}

std::optional<CellSystem> CellRefiner::parted(const CellSystem& system,
                                              std::span<const Motion> motions)
{
    if (!is_adaptive())
        return std::nullopt;
    return in_cells(system,
                    with_homes(finer_body(
                        system.shared_body(),
                        contested_leaves(system.body(), system.shares(), motions))));
}

/// With material of regions that are moved differently, and not of the deepest.
std::vector<LeafNumber>
CellRefiner::contested_leaves(const Body& body, std::span<const RegionShares> shares,
                              std::span<const Motion> motions) const
{
    const std::vector<std::vector<int>> regions =
        differing_regions(body, shares, motions);
    std::vector<LeafNumber> leaves;
    for (const LeafNumber leaf : body.octree.numbers())
        if (regions[idx(leaf)].size() > 1 &&
            body.octree[leaf].level < settings_.max_depth)
            leaves.push_back(leaf);
    return leaves;
}

std::vector<std::shared_ptr<const Body>>
CellRefiner::larger_bodies(const CellSystem& system,
                           std::span<const Motion> motions) const
{
    std::vector<std::shared_ptr<const Body>> bodies;
    for (std::shared_ptr<const Body> body = system.shared_body();
         body->cells.size() > kFewCells;)
    {
        auto larger = std::make_shared<const Body>(cut(rest_, body->octree.merge_all()));
        for (;;)
        {
            const std::vector<RegionShares> shares = regions_->shares(*larger);
            std::vector<LeafNumber> leaves = crowded_leaves(*larger, shares);
            const std::vector<LeafNumber> contested =
                contested_leaves(*larger, shares, motions);
            leaves.insert(leaves.end(), contested.begin(), contested.end());
            if (leaves.empty())
                break;
            if (2 * larger->cells.size() > body->cells.size())
                return bodies;
            larger = std::make_shared<const Body>(
                cut(rest_, larger->octree.split(leaves, has_material_), larger.get()));
        }
        if (2 * larger->cells.size() > body->cells.size())
            break;
        bodies.push_back(larger);
        body = std::move(larger);
    }
    return bodies;
}

std::vector<double> CellRefiner::errors_of(const CellSystem& system) const
{
    if (!system_settings_.departures.affine_errors)
        return pair_gaps(system.body().cells, system.glue(), system.poses());
    return settings_.errors ? settings_.errors(system)
                            : cell_errors(system.body().cells, system.glue(),
                                          system.constraints(), system.poses());
}

/// The largest error of the cells in each leaf.
std::vector<double> CellRefiner::errors_of_leaves(const CellSystem& system) const
{
    const Body& body = system.body();
    const std::vector<double> errors = errors_of(system);
    std::vector<double> worst(body.octree.leaves().size(), 0.0);
    for (std::size_t c = 0; c < errors.size(); ++c)
    {
        double& of_leaf = worst[idx(body.cells.cells[c].leaf)];
        of_leaf = std::max(of_leaf, errors[c]);
    }
    return worst;
}

std::shared_ptr<const Body> CellRefiner::partly_split(const CellSystem& system,
                                                      const Body& target) const
{
    const Body& body = system.body();
    std::vector<LeafNumber> leaves;
    for (const LeafNumber leaf : body.octree.numbers())
    {
        const Leaf& own = body.octree[leaf];
        const LeafNumber there = target.octree.find(own.corner);
        if (there == LeafNumber::None || target.octree[there].level > own.level)
            leaves.push_back(leaf);
    }
    sort_worst_first(leaves, errors_of_leaves(system));
    leaves.resize(
        static_cast<std::size_t>(kPartlySplit * static_cast<double>(leaves.size())));
    return std::make_shared<const Body>(
        cut(rest_, body.octree.split(leaves, has_material_), &body));
}

/// Of what is stretched to many times its size no error is smaller than at rest, and
/// cells without number would not make it so.
double CellRefiner::threshold_of(const CellSystem& system) const
{
    Eigen::AlignedBox3d box;
    for (const Pose& pose : system.poses())
        box.extend(pose.p);
    const double diagonal =
        std::max(rest_->frame.diagonal(), kStretched * box.diagonal().stableNorm());
    return settings_.threshold * diagonal;
}

std::optional<CellSystem> CellRefiner::finer(const CellSystem& system)
{
    const Body& body = system.body();
    const double threshold = threshold_of(system);
    const std::vector<double> worst = errors_of_leaves(system);
    const auto leaves_above = [&](double error)
    {
        std::vector<LeafNumber> leaves;
        for (const LeafNumber leaf : body.octree.numbers())
            if (worst[idx(leaf)] > error && body.octree[leaf].level < settings_.max_depth)
                leaves.push_back(leaf);
        return leaves;
    };
    num_at_limit_ = 0;
    for (const LeafNumber leaf : body.octree.numbers())
        num_at_limit_ += worst[idx(leaf)] > threshold &&
                         body.octree[leaf].level >= settings_.max_depth;
    std::vector<LeafNumber> leaves = leaves_above(threshold);
    const double num_new = 7.0 * static_cast<double>(leaves.size());
    const std::size_t added =
        worst.size() - std::min(worst.size(), coarsest_->leaves().size());
    if (num_new <= kHardlyAny * static_cast<double>(added) &&
        leaves_above(kHardlyOver * threshold).empty())
        leaves.clear();
    else if (num_new <= 7.0 * kFewSplit * static_cast<double>(worst.size()))
        leaves = leaves_above(kNearlyOver * threshold);
    sort_worst_first(leaves, worst);
    const auto num_twice = std::count_if(
        leaves.begin(), leaves.end(),
        [&](LeafNumber leaf) { return worst[idx(leaf)] > kSplitTwice * threshold; });
    return in_cells(system, with_homes(finer_body(system.shared_body(), leaves,
                                                  static_cast<std::size_t>(num_twice))));
}

std::optional<CellSystem> CellRefiner::coarser(const CellSystem& system)
{
    const Body& body = system.body();
    if (body.octree.leaves() == coarsest_->leaves())
        return std::nullopt;
    const double small = kMerge * threshold_of(system);
    const std::vector<double> errors = errors_of(system);
    std::vector<bool> may_merge(body.octree.leaves().size(), true);
    for (std::size_t c = 0; c < errors.size(); ++c)
        if (errors[c] > small)
            may_merge[idx(body.cells.cells[c].leaf)] = false;
    const std::vector<std::vector<int>> regions =
        differing_regions(body, system.shares(), system.motions());
    const auto is_contested = [&](std::span<const LeafNumber> siblings)
    {
        int one = -1;
        for (const LeafNumber leaf : siblings)
            for (const int region : regions[idx(leaf)])
            {
                if (one >= 0 &&
                    !agree(system.motions()[idx(one)], system.motions()[idx(region)]))
                    return true;
                one = region;
            }
        return false;
    };
    std::vector<LeafNumber> leaves;
    for (const std::vector<LeafNumber>& siblings : body.octree.siblings())
    {
        const Leaf& one = body.octree[siblings[0]];
        const LeafNumber base = coarsest_->find(one.corner);
        const bool is_split_for_good = (*coarsest_)[base].level >= one.level;
        if (!is_split_for_good &&
            std::all_of(siblings.begin(), siblings.end(),
                        [&](LeafNumber leaf) { return may_merge[idx(leaf)]; }) &&
            !is_contested(siblings))
            leaves.push_back(siblings[0]);
    }
    // Siblings stay as they are beside leaves that are much smaller, and where their
    // parent would leave a region no cell.
    while (!leaves.empty())
    {
        Octree octree = body.octree.merge(leaves);
        if (octree.leaves() == body.octree.leaves())
            break;
        auto merged = std::make_shared<const Body>(cut(rest_, std::move(octree), &body));
        const std::vector<LeafNumber> crowded =
            crowded_leaves(*merged, regions_->shares(*merged));
        if (crowded.empty())
            return in_cells(system, std::move(merged));
        if (std::erase_if(leaves,
                          [&](LeafNumber leaf)
                          {
                              const LeafNumber parent =
                                  merged->octree.find(body.octree[leaf].corner);
                              return std::find(crowded.begin(), crowded.end(), parent) !=
                                     crowded.end();
                          }) == 0)
            break;
    }
    return std::nullopt;
}

std::optional<CellSystem>
CellRefiner::in_cells(const CellSystem& system,
                      const std::shared_ptr<const Body>& cells) const
{
    if (cells == system.shared_body() ||
        cells->octree.leaves() == system.body().octree.leaves())
        return std::nullopt;
    return handed_to(cells, system);
}

CellSystem CellRefiner::in_cells_of(const CellSystem& other,
                                    const std::shared_ptr<const Body>& body,
                                    const CellSystemState& state) const
{
    CellSystem system(body, regions_, system_settings_);
    system.set_state(state);
    if (other.body().octree.leaves() == body->octree.leaves())
        return system;
    return handed_to(other.shared_body(), system);
}

CellSystem CellRefiner::handed_to(const std::shared_ptr<const Body>& body,
                                  const CellSystem& system) const
{
    CellSystem next(body, regions_, system_settings_);
    hand_on(system, next);
    return next;
}

void CellRefiner::hand_on(const CellSystem& from, CellSystem& to) const
{
    const Body &old = from.body(), &body = to.body();
    const std::vector<LocalMap> maps =
        local_maps(old.cells, from.glue(), from.constraints(), from.poses());
    const std::vector<Pose> poses =
        handed_on(rest_->material.grid, old.pieces, old.cells, from.poses(), maps,
                  body.octree, body.pieces, body.cells);
    to.set_state(poses, from);
}

} // namespace cellwarp::core
