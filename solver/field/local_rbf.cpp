// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/local_rbf.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <tuple>
#include <unordered_map>

#include "octree/base/hash.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/smooth_step.h"

namespace cellwarp::core
{

namespace
{

/// How far the two cells of an unglued pair go apart at the middle between them [edge]
/// where their clusters begin to give way to the blend, and where they have done so. An
/// RBF that has to bridge more than that swings.
constexpr double kTornFrom = 0.15, kTornTo = 0.5;

/// A box of the octree: its edge and its place among those of this size.
using BoxKey = std::tuple<double, std::int64_t, std::int64_t, std::int64_t>;

struct BoxHash
{
    std::size_t operator()(const BoxKey& key) const
    {
        const auto& [edge, x, y, z] = key;
        std::uint64_t hash = std::bit_cast<std::uint64_t>(edge);
        for (const std::int64_t k : {x, y, z})
            hash = hash_of(hash + static_cast<std::uint64_t>(k));
        return static_cast<std::size_t>(hash);
    }
};

/// The box of \p larger times a cell's size that holds the box beside the cell's by \p
/// step along the axis.
BoxKey key_of(const Cells& cells, const Cell& cell, int axis = 0, int step = 0,
              int larger = 1)
{
    Eigen::Vector3d at = (cell.box_centre - cells.corner) / cell.edge;
    at[axis] += step;
    const Eigen::Array3d box = (at.array() / larger).floor();
    return {larger * cell.edge, std::llround(box.x()), std::llround(box.y()),
            std::llround(box.z())};
}

/// How much an unglued pair is torn apart: from 0 to 1.
double tear_of(const Cells& cells, const std::array<int, 2>& pair,
               std::span<const Pose> poses)
{
    const Cell& a = cells.cells[idx(pair[0])];
    const Cell& b = cells.cells[idx(pair[1])];
    const Eigen::Vector3d middle = 0.5 * (a.anchor + b.anchor);
    const double apart = (displacement(poses[idx(pair[0])], a.centre, middle) -
                          displacement(poses[idx(pair[1])], b.centre, middle))
                             .norm() /
                         std::min(a.edge, b.edge);
    return smooth_step(kTornFrom, kTornTo, apart);
}

} // namespace

std::vector<std::array<int, 2>> unglued_pairs(const Cells& cells)
{
    std::unordered_map<BoxKey, std::vector<int>, BoxHash> in_box;
    in_box.reserve(cells.size());
    for (std::size_t c = 0; c < cells.size(); ++c)
        in_box[key_of(cells, cells.cells[c])].push_back(static_cast<int>(c));
    std::vector<std::array<int, 2>> pairs;
    const auto add = [&](int a, const std::vector<int>& others)
    {
        const std::span<const int> glued = cells.neighbours_of(a);
        for (const int b : others)
            if (b != a && !std::binary_search(glued.begin(), glued.end(), b))
                pairs.push_back({std::min(a, b), std::max(a, b)});
    };
    constexpr int kLargest = 4; // neighbours' edge over a cell's own, at the most
    for (std::size_t c = 0; c < cells.size(); ++c)
    {
        const Cell& cell = cells.cells[c];
        add(static_cast<int>(c), in_box[key_of(cells, cell)]);
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1})
                for (int larger = 1; larger <= kLargest; larger *= 2)
                    if (const auto other =
                            in_box.find(key_of(cells, cell, axis, step, larger));
                        other != in_box.end())
                    {
                        add(static_cast<int>(c), other->second);
                        break; // boxes do not overlap
                    }
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return pairs;
}

/// The sums run over the cells in their order, so that a place gets the same bits
/// whichever other cells are looked at.
void LocalRbf::find_shares(std::span<const InfluenceOnPlaces> influences,
                           bool wants_gradient, Shares& out) const
{
    out.clear();
    for (const InfluenceOnPlaces& influence : influences)
    {
        if ((influence.weight == 0.0).all())
            continue;
        for (const Membership& membership : clusters_->of_cell(influence.cell))
        {
            auto share = std::lower_bound(out.begin(), out.end(), membership.cluster,
                                          [](const Share& known, int cluster)
                                          { return known.cluster < cluster; });
            if (share == out.end() || share->cluster != membership.cluster)
            {
                share = out.emplace(share);
                share->cluster = membership.cluster;
            }
            share->weight += membership.weight * influence.weight;
            if (wants_gradient)
                share->gradient += membership.weight * influence.gradient;
        }
    }
}

void LocalRbf::value(const PlaceVectors& places, const Shares& shares,
                     const ValueOnPlaces& blended, ValueOnPlaces& out) const
{
    out = {};
    PlaceNumbers total = PlaceNumbers::Zero();
    PlaceVectors total_gradient = PlaceVectors::Zero();
    ValueOnPlaces fit;
    for (const Share& share : shares)
    {
        if (share.cluster == kBlended)
            fit = blended;
        else
            fits_[idx(share.cluster)]->value(places, fit);
        total += share.weight;
        total_gradient += share.gradient;
        for (int k = 0; k < 3; ++k)
            out.displacement.col(k) += share.weight * fit.displacement.col(k);
        for (int axis = 0; axis < 3; ++axis)
        {
            const std::size_t a = idx(axis);
            for (int k = 0; k < 3; ++k)
                out.slopes[a].col(k) +=
                    share.weight * fit.slopes[a].col(k) +
                    fit.displacement.col(k) * share.gradient.col(axis);
        }
    }
    for (int k = 0; k < 3; ++k)
        out.displacement.col(k) /= total;
    for (int axis = 0; axis < 3; ++axis)
        for (int k = 0; k < 3; ++k)
        {
            PlaceVectors& slope = out.slopes[idx(axis)];
            slope.col(k) =
                (slope.col(k) - out.displacement.col(k) * total_gradient.col(axis)) /
                total;
        }
}

void LocalRbf::displacement(const PlaceVectors& places, const Shares& shares,
                            const ValueOnPlaces& blended, PlaceVectors& out) const
{
    out.setZero();
    PlaceNumbers total = PlaceNumbers::Zero();
    PlaceVectors fit;
    for (const Share& share : shares)
    {
        if (share.cluster == kBlended)
            fit = blended.displacement;
        else
            fits_[idx(share.cluster)]->displacement(places, fit);
        total += share.weight;
        for (int k = 0; k < 3; ++k)
            out.col(k) += share.weight * fit.col(k);
    }
    for (int k = 0; k < 3; ++k)
        out.col(k) /= total;
}

LocalRbfFitter::LocalRbfFitter(const Cells& cells,
                               std::span<const Constraint> constraints,
                               const ClusterSize& size, RbfSystems* systems)
    : cells_(cells), choice_(cells, constraints), unglued_(unglued_pairs(cells)),
      systems_(systems)
{
    std::vector<bool> is_idle;
    for (const Constraint& constraint : constraints)
        is_idle.push_back(constraint.hold == Hold::Idle);
    clusters_ = std::make_shared<const Clusters>(grow_clusters(cells, is_idle, size));
    fits_.resize(clusters_->clusters.size());
    if (unglued_.empty())
        return;
    std::vector<char> is_in_pair(cells.size(), 0);
    for (const std::array<int, 2>& pair : unglued_)
        is_in_pair[idx(pair[0])] = is_in_pair[idx(pair[1])] = 1;
    clusters_of_.resize(cells.size());
    for (std::size_t c = 0; c < clusters_->clusters.size(); ++c)
        for (const int cell : clusters_->clusters[c].cells)
            if (is_in_pair[idx(cell)])
                clusters_of_[idx(cell)].push_back(static_cast<int>(c));
}

std::shared_ptr<const Clusters>
LocalRbfFitter::without_torn(std::span<const Pose> poses) const
{
    std::vector<double> tears(clusters_->clusters.size(), 0.0);
    bool has_any = false;
    std::vector<int> both;
    for (const std::array<int, 2>& pair : unglued_)
    {
        both.clear();
        const std::vector<int>& a = clusters_of_[idx(pair[0])];
        const std::vector<int>& b = clusters_of_[idx(pair[1])];
        std::set_intersection(a.begin(), a.end(), b.begin(), b.end(),
                              std::back_inserter(both));
        if (both.empty())
            continue; // they are far from each other through the glue
        const double tear = tear_of(cells_, pair, poses);
        has_any = has_any || tear > 0.0;
        for (const int c : both)
            tears[idx(c)] = std::max(tears[idx(c)], tear);
    }
    if (!has_any)
        return clusters_;
    auto changed = std::make_shared<Clusters>();
    changed->clusters = clusters_->clusters;
    changed->first_membership.push_back(0);
    for (std::size_t cell = 0; cell < cells_.size(); ++cell)
    {
        for (const Membership& membership : clusters_->of_cell(static_cast<int>(cell)))
            if (const double tear = tears[idx(membership.cluster)]; tear > 0.0)
                changed->memberships.push_back(
                    {LocalRbf::kBlended, membership.weight * tear});
        for (const Membership& membership : clusters_->of_cell(static_cast<int>(cell)))
            if (const double rest = 1.0 - tears[idx(membership.cluster)]; rest > 0.0)
                changed->memberships.push_back(
                    {membership.cluster, membership.weight * rest});
        changed->first_membership.push_back(
            static_cast<int>(changed->memberships.size()));
    }
    return changed;
}

void LocalRbfFitter::fit_one(std::size_t cluster, std::span<const Pose> poses)
{
    ClusterFit& fit = fits_[cluster];
    RbfCentres centres = choice_.centres_of(clusters_->clusters[cluster].cells, poses);
    const bool has_same_centres =
        fit.field && RbfSystems::are_same(centres.points, fit.centres.points);
    fit.was_solved =
        !has_same_centres || centres.displacements != fit.centres.displacements;
    fit.was_factored = false;
    if (!fit.was_solved)
        return;
    RbfSystems::Found found;
    if (has_same_centres && fit.system)
        found = {fit.system, false, true};
    else if (systems_)
        found = systems_->system_of(centres.points);
    else
        found = {std::make_shared<const RbfSystem>(centres.points), true, false};
    fit.was_factored = found.is_new;
    RbfSystem::Fit solved = found.system->fit(centres.displacements);
    fit.field = std::make_shared<const RbfField>(std::move(solved.field));
    fit.residual = solved.residual;
    fit.centres = std::move(centres);
    fit.system = found.is_kept ? std::move(found.system) : nullptr;
}

LocalRbf LocalRbfFitter::fit(std::span<const Pose> poses)
{
    parallel_for(fits_.size(), [&](std::size_t c) { fit_one(c, poses); });
    if (systems_)
        systems_->drop_unused();
    LocalRbf::Fits fields;
    for (const ClusterFit& fit : fits_)
        fields.push_back(fit.field);
    return LocalRbf(without_torn(poses), std::move(fields));
}

double LocalRbfFitter::residual() const
{
    double largest = 0.0;
    for (const ClusterFit& fit : fits_)
        largest = std::max(largest, fit.residual);
    return largest;
}

std::size_t LocalRbfFitter::num_solved() const
{
    return idx(std::count_if(fits_.begin(), fits_.end(),
                             [](const ClusterFit& fit) { return fit.was_solved; }));
}

std::size_t LocalRbfFitter::num_factored() const
{
    return idx(std::count_if(fits_.begin(), fits_.end(),
                             [](const ClusterFit& fit) { return fit.was_factored; }));
}

} // namespace cellwarp::core
