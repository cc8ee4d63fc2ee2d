// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/sample_blend.h"

#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

std::vector<char> idle_cells(const Cells& cells, std::span<const Constraint> constraints)
{
    std::vector<char> is_idle(cells.size(), false);
    for (std::size_t i = 0; i < constraints.size(); ++i)
        is_idle[i] = constraints[i].hold == Hold::Idle;
    return is_idle;
}

std::vector<Eigen::Vector3f> sorted_back(std::span<const float> values,
                                         std::span<const std::uint32_t> order)
{
    std::vector<Eigen::Vector3f> result(order.size());
    for (std::size_t i = 0; i < order.size(); ++i)
        result[order[i]] = Eigen::Map<const Eigen::Vector3f>(&values[3 * i]);
    return result;
}

} // namespace

SampleBlend::SampleBlend(FieldKind kind, const Cells& cells, const SampleSet& samples,
                         std::span<const Constraint> constraints,
                         std::span<const FadedRegion> regions)
    : cells_(cells), influences_(cells, kind == FieldKind::Closest4),
      nodes_(cells, influences_, regions),
      places_(BlendTable::Kind::Places, samples, cells, idle_cells(cells, constraints),
              influences_, nodes_),
      normals_(BlendTable::Kind::Normals, samples, cells, idle_cells(cells, constraints),
               influences_, nodes_),
      maps_(cells.size() + regions.size()), instruction_set_(instruction_sets().back())
{
    const std::span<FadeTerm> terms[] = {places_.terms(), normals_.terms()};
    nodes_.tabulate(influences_, terms);
}

void SampleBlend::apply(std::span<const Pose> poses, std::span<const Motion> motions)
{
    // As displacements, so that what is at rest stays there to the bit.
    parallel_for(poses.size(),
                 [&](std::size_t i)
                 {
                     const Eigen::Vector3d& centre = cells_.cells[i].centre;
                     maps_[i].A = poses[i].R - Eigen::Matrix3d::Identity();
                     maps_[i].b = displacement(poses[i], centre, Eigen::Vector3d::Zero());
                 });
    for (std::size_t r = 0; r < motions.size(); ++r)
        maps_[poses.size() + r] = {motions[r].R - Eigen::Matrix3d::Identity(),
                                   motions[r].t};
    nodes_.find_misses(maps_);
    const BlendKernels kernels = blend_kernels(instruction_set_);
    places_.apply(maps_, nodes_.misses(), kernels);
    normals_.apply(maps_, nodes_.misses(), kernels);
}

std::vector<Eigen::Vector3f> SampleBlend::positions_as_given() const
{
    return sorted_back(positions(), order());
}

std::vector<Eigen::Vector3f> SampleBlend::normals_as_given() const
{
    return sorted_back(normals(), normal_order());
}

} // namespace cellwarp::core
