// SPDX-License-Identifier: GPL-3.0-or-later
// The samples to which the voxels of material are nearest, through the material.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/material_blocks.h"
#include "octree/notches.h"
#include "octree/voxel_grid.h"
#include "octree/voxel_runs.h"

namespace cellwarp::core
{

/// The samples near each block of material. A sample reaches from block to block as far
/// as these hold together (so never across a gap or an open side of a notch), in order of
/// the radius of the smallest ball around it that the way there stays in. Keeps
/// references to grid, samples and notches. Immutable once built, safe for many threads.
///
/// Linear in the number of blocks: the voxels of most blocks all have samples of one kind
/// nearest to them. nearest_sample.cpp explains how the others are found.
class NearestSamples
{
public:
    /// \p voxel_of_sample: Parts::voxel_of_sample.
    NearestSamples(const VoxelGrid& grid, std::span<const Eigen::Vector3d> samples,
                   std::span<const std::size_t> voxel_of_sample, const Notches& notches);

    /// For each kind the voxels whose nearest sample is of that kind; of samples at equal
    /// distances (to 7e-4 voxels) the first counts. What no sample reaches is in none,
    /// and nothing is looked for of kind 0, whose voxels are left empty.
    /// \param kind_of_sample below \p num_kinds
    std::vector<VoxelRuns> voxels_of(std::span<const std::uint32_t> kind_of_sample,
                                     std::size_t num_kinds) const;

private:
    static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

    /// A sample that has reached a part of the blocks.
    struct Label
    {
        std::uint32_t radius = kNone; ///< of the ball [kSame]
        std::uint32_t sample = kNone;
        std::uint32_t home = kNone; ///< the part that it comes from
        std::uint32_t next = kNone; ///< the part's next label, of another kind
    };
    class Flood;
    class MixedPart;

    void find_own_samples(std::span<const std::size_t> voxel_of_sample);
    std::span<const std::uint32_t> own_samples(std::size_t part) const
    {
        return std::span(own_).subspan(first_own_[part],
                                       first_own_[part + 1] - first_own_[part]);
    }

    const VoxelGrid& grid_;
    std::span<const Eigen::Vector3d> samples_;
    MaterialBlocks parts_;
    std::vector<std::uint32_t> first_own_; ///< of each part, and one for their end
    std::vector<std::uint32_t> own_;       ///< the samples that touch it, ascending
    std::vector<Label> nearest_;           ///< of each part: to the middle of its block
};

} // namespace cellwarp::core
