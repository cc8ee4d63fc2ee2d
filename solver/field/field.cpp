// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/field.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

/// Clusters of the release field, by distance from the RBF through all cells and time,
/// bar of 2,048 cells turned by 135 degrees | sample creature:
///   core, support, reach   largest distance [diagonal]   to fit and to apply [ms]
///   3, 2, 2                2.1e-4 | 2.3e-4                75, 8  | 125, 30
///   3, 2, 3                6.5e-5 | 2.0e-4               176, 11 | 243, 41
///   2, 3, 3                6.5e-5 | 1.9e-4               173, 17 | 346, 76
///   2, 3, 4                3.8e-5 | 9.6e-5               421, 23 | 714, 108
constexpr ClusterSize kClusterSize = {3, 2.0, 3.0};

/// Over how far outside its cell's box a point leaves the RBF for the cells' own rigid
/// motions [edge].
constexpr double kOutside = 1.0;

} // namespace

Field::Field(FieldKind kind, const Cells& cells, std::vector<Pose> poses,
             std::span<const Constraint> constraints, std::vector<MovedRegion> regions)
    : kind_(kind), cells_(cells), poses_(std::move(poses)), closest_(cells)
{
    is_idle_.assign(cells.size(), false);
    for (std::size_t i = 0; i < constraints.size(); ++i)
        is_idle_[i] = constraints[i].hold == Hold::Idle;
    if (kind == FieldKind::Closest4)
        closest4_.emplace(cells);
    if (kind == FieldKind::Rbf || kind == FieldKind::RbfGlobal)
    {
        const CentreChoice choice(cells, poses_, constraints);
        std::vector<int> all(cells.size());
        std::iota(all.begin(), all.end(), 0);
        const RbfCentres centres = choice.centres_of(all);
        num_centres_ = centres.points.size();
        if (kind == FieldKind::Rbf)
            local_.emplace(choice, grow_clusters(cells, is_idle_, kClusterSize));
        else
            global_.emplace(centres.points, centres.displacements);
    }
    for (MovedRegion& region : regions)
    {
        const std::vector<Eigen::Vector3d>& nodes = region.fade->nodes();
        const std::vector<int>& own = region.fade->node_cells();
        const Eigen::Matrix3d turn = region.motion.R - Eigen::Matrix3d::Identity();
        region.misses.resize(nodes.size());
        const std::vector<bool> follows = followers_of(region.motion, constraints);
        parallel_for(
            nodes.size(),
            [&](std::size_t i)
            {
                std::vector<Influence> influences, near;
                closest_.influences(nodes[i], own[i], influences);
                // Most nodes lie deep in their region, and nothing is missed.
                if (std::all_of(
                        influences.begin(), influences.end(),
                        [&](const Influence& influence)
                        { return follows[static_cast<std::size_t>(influence.cell)]; }))
                    return;
                const FieldValue f =
                    base(nodes[i], own[i], influences, near, !region.may_turn);
                region.misses[i].displacement =
                    turn * nodes[i] + region.motion.t - f.displacement;
                if (!region.may_turn)
                    region.misses[i].gradient = turn - f.gradient;
            });
    }
    regions_ = MovedRegions(std::move(regions), cells.size());
}

std::vector<bool> Field::followers_of(const Motion& motion,
                                      std::span<const Constraint> constraints) const
{
    std::vector<bool> follows(cells_.size(), false);
    if (closest4_ || global_)
        return follows;
    for (std::size_t i = 0; i < constraints.size(); ++i)
    {
        const Pose wanted = carried(motion, cells_.cells[i].centre);
        follows[i] = constraints[i].hold == Hold::Prescribed && poses_[i].p == wanted.p &&
                     poses_[i].R == wanted.R;
    }
    if (!local_)
        return follows;
    std::vector<bool> by_clusters = follows;
    for (std::size_t i = 0; i < constraints.size(); ++i)
        for (const Membership& member : local_->clusters().of_cell(static_cast<int>(i)))
            for (const int cell : local_->clusters()
                                      .clusters[static_cast<std::size_t>(member.cluster)]
                                      .cells)
                by_clusters[i] =
                    by_clusters[i] && follows[static_cast<std::size_t>(cell)];
    return by_clusters;
}

double Field::residual() const
{
    return local_ ? local_->residual() : global_ ? global_->residual() : 0.0;
}

FieldValue Field::base(const Eigen::Vector3d& x, int own,
                       std::span<const Influence> influences,
                       std::vector<Influence>& near, bool wants_gradient) const
{
    if (!local_ && !global_)
    {
        if (!closest4_)
            return blended(influences, poses_, cells_, x);
        closest4_->influences(x, near);
        return blended(near, poses_, cells_, x);
    }
    FieldValue value;
    if (wants_gradient)
        value = local_ ? local_->value(x, influences) : global_->value(x);
    else
        value.displacement =
            local_ ? local_->displacement(x, influences) : global_->displacement(x);
    const Cell& cell = cells_.cells[static_cast<std::size_t>(own)];
    const Eigen::Vector3d beyond = x - nearest_in_box(cell.box_centre, cell.edge, x);
    const double distance = beyond.norm();
    if (distance == 0.0)
        return value;
    // An RBF grows without bound: it gives way to the rigid motions around.
    const double u = std::min(1.0, distance / (kOutside * cell.edge));
    const double share = u * u * u * (10.0 + u * (6.0 * u - 15.0));
    const double slope =
        30.0 * u * u * (1.0 - u) * (1.0 - u) / (kOutside * cell.edge * distance);
    const FieldValue outside = blended(influences, poses_, cells_, x);
    const Eigen::Vector3d difference = outside.displacement - value.displacement;
    value.displacement += share * difference;
    value.gradient += share * (outside.gradient - value.gradient) +
                      difference * (slope * beyond).transpose();
    return value;
}

FieldValue Field::value(const Eigen::Vector3d& x, int own) const
{
    if (is_idle_[static_cast<std::size_t>(own)])
        return {};
    std::vector<Influence> influences, near;
    closest_.influences(x, own, influences);
    return regions_.correct(x, influences,
                            [&] { return base(x, own, influences, near, true); });
}

std::vector<Eigen::Vector3d> Field::displacements(std::span<const Eigen::Vector3d> points,
                                                  std::span<const int> own) const
{
    std::vector<Eigen::Vector3d> result(points.size());
    parallel_ranges(points.size(), 256,
                    [&](std::size_t begin, std::size_t end)
                    {
                        std::vector<Influence> influences, near;
                        for (std::size_t i = begin; i < end; ++i)
                        {
                            result[i].setZero();
                            if (is_idle_[static_cast<std::size_t>(own[i])])
                                continue;
                            closest_.influences(points[i], own[i], influences);
                            result[i] =
                                regions_
                                    .correct(points[i], influences,
                                             [&] {
                                                 return base(points[i], own[i],
                                                             influences, near, false);
                                             })
                                    .displacement;
                        }
                    });
    return result;
}

} // namespace cellwarp
