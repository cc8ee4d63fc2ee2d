// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/local_rbf.h"

#include <algorithm>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp
{

/// Ascending by cluster. The sums run over the cells in their order, so that a place gets
/// the same bits whichever other cells are looked at.
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

void LocalRbf::value(const PlaceVectors& places,
                     std::span<const InfluenceOnPlaces> influences, Shares& scratch,
                     ValueOnPlaces& out) const
{
    find_shares(influences, true, scratch);
    out = {};
    PlaceNumbers total = PlaceNumbers::Zero();
    PlaceVectors total_gradient = PlaceVectors::Zero();
    ValueOnPlaces fit;
    for (const Share& share : scratch)
    {
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

void LocalRbf::displacement(const PlaceVectors& places,
                            std::span<const InfluenceOnPlaces> influences,
                            Shares& scratch, PlaceVectors& out) const
{
    find_shares(influences, false, scratch);
    out.setZero();
    PlaceNumbers total = PlaceNumbers::Zero();
    PlaceVectors fit;
    for (const Share& share : scratch)
    {
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
                               const ClusterSize& size, bool keeps_systems)
    : choice_(cells, constraints), keeps_systems_(keeps_systems)
{
    std::vector<bool> is_idle;
    for (const Constraint& constraint : constraints)
        is_idle.push_back(constraint.hold == Hold::Idle);
    clusters_ = std::make_shared<const Clusters>(grow_clusters(cells, is_idle, size));
    fits_.resize(clusters_->clusters.size());
}

void LocalRbfFitter::fit_one(std::size_t cluster, std::span<const Pose> poses)
{
    ClusterFit& fit = fits_[cluster];
    RbfCentres centres = choice_.centres_of(clusters_->clusters[cluster].cells, poses);
    const bool is_same_system = fit.field && centres.points == fit.centres.points;
    fit.was_solved =
        !is_same_system || centres.displacements != fit.centres.displacements;
    fit.was_factored = fit.was_solved && !(is_same_system && fit.system);
    if (!fit.was_solved)
        return;
    if (fit.was_factored)
        fit.system.emplace(centres.points);
    RbfSystem::Fit found = fit.system->fit(centres.displacements);
    fit.field = std::make_shared<const RbfField>(std::move(found.field));
    fit.residual = found.residual;
    fit.centres = std::move(centres);
    if (!keeps_systems_)
        fit.system.reset();
}

std::optional<LocalRbf> LocalRbfFitter::fit(std::span<const Pose> poses,
                                            std::stop_token stop)
{
    parallel_for(fits_.size(),
                 [&](std::size_t c)
                 {
                     if (!stop.stop_requested())
                         fit_one(c, poses);
                 });
    if (stop.stop_requested())
        return std::nullopt;
    LocalRbf::Fits fields;
    for (const ClusterFit& fit : fits_)
        fields.push_back(fit.field);
    return LocalRbf(clusters_, std::move(fields));
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

} // namespace cellwarp
