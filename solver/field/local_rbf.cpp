// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/local_rbf.h"

#include <algorithm>
#include <optional>

#include "octree/parallel.h"

namespace cellwarp
{

LocalRbf::LocalRbf(const CentreChoice& choice, Clusters clusters)
    : clusters_(std::move(clusters))
{
    std::vector<std::optional<RbfField>> fits(clusters_.clusters.size());
    parallel_for(fits.size(),
                 [&](std::size_t c)
                 {
                     const RbfCentres centres =
                         choice.centres_of(clusters_.clusters[c].cells);
                     fits[c].emplace(centres.points, centres.displacements);
                 });
    for (std::optional<RbfField>& fit : fits)
    {
        residual_ = std::max(residual_, fit->residual());
        fits_.push_back(std::move(*fit));
    }
}

std::vector<LocalRbf::Share> LocalRbf::shares(std::span<const Influence> influences) const
{
    std::vector<Share> found;
    for (const Influence& influence : influences)
        for (const Membership& membership : clusters_.of_cell(influence.cell))
        {
            auto share = std::find_if(found.begin(), found.end(),
                                      [&](const Share& known)
                                      { return known.cluster == membership.cluster; });
            if (share == found.end())
                share = found.insert(found.end(), Share{membership.cluster});
            share->weight += membership.weight * influence.weight;
            share->gradient += membership.weight * influence.gradient;
        }
    return found;
}

FieldValue LocalRbf::value(const Eigen::Vector3d& x,
                           std::span<const Influence> influences) const
{
    FieldValue sum;
    double total = 0.0;
    Eigen::Vector3d total_gradient = Eigen::Vector3d::Zero();
    for (const Share& share : shares(influences))
    {
        const FieldValue fit = fits_[static_cast<std::size_t>(share.cluster)].value(x);
        total += share.weight;
        total_gradient += share.gradient;
        sum.displacement += share.weight * fit.displacement;
        sum.gradient +=
            share.weight * fit.gradient + fit.displacement * share.gradient.transpose();
    }
    sum.displacement /= total;
    sum.gradient = (sum.gradient - sum.displacement * total_gradient.transpose()) / total;
    return sum;
}

Eigen::Vector3d LocalRbf::displacement(const Eigen::Vector3d& x,
                                       std::span<const Influence> influences) const
{
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double total = 0.0;
    for (const Share& share : shares(influences))
    {
        total += share.weight;
        sum +=
            share.weight * fits_[static_cast<std::size_t>(share.cluster)].displacement(x);
    }
    return sum / total;
}

} // namespace cellwarp
