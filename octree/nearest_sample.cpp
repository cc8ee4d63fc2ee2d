// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/nearest_sample.h"

#include <cmath>
#include <utility>
#include <vector>

#include "octree/hold_together.h"

namespace cellwarp
{

namespace
{

/// Distances that the front takes together [voxel]: finer changes nothing that a
/// majority of voxels would notice.
constexpr double kStep = 0.25;

/// Distances are told apart to a step of this [voxel]; of equal ones the first sample
/// counts. So rounding decides nothing where voxels lie just between samples, and is
/// unlikely to elsewhere: no regular grid has its distances on such an odd number.
constexpr double kSame = 7.0710678e-4;

} // namespace

VoxelNumbers<std::uint32_t> nearest_samples(const VoxelGrid& grid,
                                            std::span<const Eigen::Vector3d> samples,
                                            std::span<const std::size_t> voxel_of_sample,
                                            const Notches& notches)
{
    VoxelNumbers<std::uint32_t> nearest(grid.size());
    // [kSame]; without one, the largest number
    VoxelNumbers<std::uint32_t> distance(grid.size());
    struct Entry
    {
        std::size_t voxel;
        std::uint32_t sample;
        std::uint32_t distance;
    };
    // A queue by distance: one bucket a step.
    std::vector<std::vector<Entry>> buckets(1);
    const auto offer = [&](const Eigen::Vector3i& place, std::uint32_t sample)
    {
        const std::size_t voxel = grid.index(place);
        const double length =
            (grid.centre(place) - samples[sample]).norm() / grid.shape().voxel();
        const std::uint32_t d = static_cast<std::uint32_t>(std::lround(length / kSame));
        if (std::pair(d, sample) >= std::pair(distance[voxel], nearest[voxel]))
            return;
        distance.set(voxel, d);
        nearest.set(voxel, sample);
        const std::size_t bucket = static_cast<std::size_t>(d * kSame / kStep);
        if (bucket >= buckets.size())
            buckets.resize(bucket + 1);
        buckets[bucket].push_back({voxel, sample, d});
    };
    const VoxelFlags& material = grid.material();
    for (std::size_t i = 0; i < samples.size(); ++i)
    {
        const std::uint32_t sample = static_cast<std::uint32_t>(i);
        bool is_in_its_own = false; // material
        for_each_voxel(grid.touched(samples[i]),
                       [&](const Eigen::Vector3i& voxel)
                       {
                           const std::uint8_t there = material[grid.index(voxel)];
                           if (there == 0 || (!voxel_of_sample.empty() &&
                                              there != material[voxel_of_sample[i]]))
                               return;
                           offer(voxel, sample);
                           is_in_its_own = true;
                       });
        if (!is_in_its_own && !voxel_of_sample.empty())
            offer(grid.coordinates(voxel_of_sample[i]), sample);
    }
    for (std::size_t bucket = 0; bucket < buckets.size(); ++bucket)
        for (std::size_t next = 0; next < buckets[bucket].size(); ++next)
        {
            const Entry entry = buckets[bucket][next];
            if (entry.distance != distance[entry.voxel] ||
                nearest[entry.voxel] != entry.sample)
                continue;
            const Eigen::Vector3i from = grid.coordinates(entry.voxel);
            for_each_beside(from,
                            [&](const Eigen::Vector3i& other)
                            {
                                if (grid.contains(other) &&
                                    hold_together(grid, notches, from, other))
                                    offer(other, entry.sample);
                            });
        }
    return nearest;
}

} // namespace cellwarp
