// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/field.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include "octree/parallel.h"

namespace cellwarp
{

RbfCentres rbf_centres(const Cells& cells, std::span<const Pose> poses,
                       std::span<const Constraint> constraints)
{
    RbfCentres centres;
    double finest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        if (constraints[i].hold == Hold::Idle)
            continue;
        const Eigen::Vector3d& centre = cells.cells[i].centre;
        centres.points.push_back(centre);
        centres.displacements.push_back(displacement(poses[i], centre, centre));
        finest = std::min(finest, cells.cells[i].edge);
    }
    // Corners of leaves lie on the lattice of half the finest edge.
    struct Corner
    {
        Eigen::Vector3d point, displacement;
        bool is_shared_by_different = false;
    };
    std::map<std::array<std::int64_t, 3>, Corner> corners;
    const Eigen::Vector3d origin =
        cells.cells.empty() ? Eigen::Vector3d::Zero() : cells.cells.front().box_centre;
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        if (constraints[i].hold != Hold::Prescribed)
            continue;
        const Cell& cell = cells.cells[i];
        for (int k = 0; k < 8; ++k)
        {
            const Eigen::Vector3d side(k & 1 ? 0.5 : -0.5, k & 2 ? 0.5 : -0.5,
                                       k & 4 ? 0.5 : -0.5);
            const Eigen::Vector3d point = cell.box_centre + cell.edge * side;
            std::array<std::int64_t, 3> key;
            for (int axis = 0; axis < 3; ++axis)
                key[static_cast<std::size_t>(axis)] =
                    std::llround((point[axis] - origin[axis]) / finest * 2.0);
            const Eigen::Vector3d d = displacement(poses[i], cell.centre, point);
            const auto [found, is_new] = corners.try_emplace(key, Corner{point, d});
            // Motions that agree here to a millionth of a cell are one.
            if (!is_new && (found->second.displacement - d).norm() > 1e-6 * cell.edge)
                found->second.is_shared_by_different = true;
        }
    }
    for (const auto& [key, corner] : corners)
        if (!corner.is_shared_by_different)
        {
            centres.points.push_back(corner.point);
            centres.displacements.push_back(corner.displacement);
        }
    return centres;
}

Field::Field(FieldKind kind, const Cells& cells, std::vector<Pose> poses,
             std::span<const Constraint> constraints, std::vector<MovedRegion> regions)
    : kind_(kind), cells_(cells), poses_(std::move(poses)), closest_(cells)
{
    is_idle_.assign(cells.size(), false);
    for (std::size_t i = 0; i < constraints.size(); ++i)
        is_idle_[i] = constraints[i].hold == Hold::Idle;
    if (kind == FieldKind::Closest4)
        closest4_.emplace(cells);
    if (kind == FieldKind::Rbf)
    {
        const RbfCentres centres = rbf_centres(cells, poses_, constraints);
        rbf_.emplace(centres.points, centres.displacements);
    }
    for (MovedRegion& region : regions)
    {
        const std::vector<Eigen::Vector3d>& nodes = region.fade->nodes();
        const std::vector<int>& own = region.fade->node_cells();
        const Eigen::Matrix3d turn = region.motion.R - Eigen::Matrix3d::Identity();
        region.misses.resize(nodes.size());
        parallel_for(nodes.size(),
                     [&](std::size_t i)
                     {
                         std::vector<Influence> influences, near;
                         closest_.influences(nodes[i], own[i], influences);
                         const FieldValue f =
                             base(nodes[i], influences, near, !region.may_turn);
                         region.misses[i].displacement =
                             turn * nodes[i] + region.motion.t - f.displacement;
                         if (!region.may_turn)
                             region.misses[i].gradient = turn - f.gradient;
                     });
    }
    regions_ = MovedRegions(std::move(regions), cells.size());
}

FieldValue Field::base(const Eigen::Vector3d& x, std::span<const Influence> influences,
                       std::vector<Influence>& near, bool wants_gradient) const
{
    if (rbf_)
        return wants_gradient
                   ? rbf_->value(x)
                   : FieldValue{rbf_->displacement(x), Eigen::Matrix3d::Zero()};
    if (!closest4_)
        return blended(influences, poses_, cells_, x);
    closest4_->influences(x, near);
    return blended(near, poses_, cells_, x);
}

FieldValue Field::value(const Eigen::Vector3d& x, int own) const
{
    if (is_idle_[static_cast<std::size_t>(own)])
        return {};
    std::vector<Influence> influences, near;
    closest_.influences(x, own, influences);
    return regions_.correct(base(x, influences, near, true), x, influences);
}

std::vector<Eigen::Vector3d> Field::displacements(std::span<const Eigen::Vector3d> points,
                                                  std::span<const int> own) const
{
    std::vector<Eigen::Vector3d> result(points.size());
    parallel_ranges(
        points.size(), 256,
        [&](std::size_t begin, std::size_t end)
        {
            std::vector<Influence> influences, near;
            for (std::size_t i = begin; i < end; ++i)
            {
                result[i].setZero();
                if (is_idle_[static_cast<std::size_t>(own[i])])
                    continue;
                closest_.influences(points[i], own[i], influences);
                const FieldValue value = base(points[i], influences, near, false);
                result[i] = regions_.correct(value, points[i], influences).displacement;
            }
        });
    return result;
}

} // namespace cellwarp
