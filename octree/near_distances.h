// SPDX-License-Identifier: GPL-3.0-or-later
// Exact Euclidean distances on a grid up to a reach: for closing the gaps of soups and
// clouds, and for telling what is near. Only what is near takes time and memory.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "octree/voxel_values.h"

namespace cellwarp::core
{

/// Squared distances up to a reach [voxel].
class NearDistances
{
public:
    /// The farthest that can be told apart [voxel].
    static constexpr double kFarthest = 180.0;

    /// Of the voxels that are at most \p reach from one that is not 0 in \p marks. x runs
    /// fastest. A reach beyond kFarthest counts as that.
    NearDistances(const VoxelFlags& marks, const Eigen::Vector3i& counts, double reach);

    /// Whether a voxel is farther from all marks than the reach.
    bool is_far(std::size_t voxel) const { return codes_[voxel] == 0; }
    /// Of a voxel that is not far.
    std::uint32_t squared(std::size_t voxel) const { return codes_[voxel] - 1u; }
    /// Whether a voxel is farther from all marks than \p distance, at most the reach.
    bool is_beyond(std::size_t voxel, double distance) const
    {
        return is_far(voxel) || squared(voxel) > distance * distance;
    }
    /// Voxels that follow each other along x, from a multiple of this on.
    static constexpr std::size_t kGroup = 32;

    /// Calls visit(x) for the voxels of a line along x that are not far, ascending. Lines
    /// are counted by y, then z.
    template <class Visit>
    void for_each_near(std::size_t line, Visit&& visit) const
    {
        for (std::size_t x = 0; x < nx_; x += kGroup)
            if (is_near_[(line * nx_groups() + x / kGroup)])
                for (std::size_t i = x; i < std::min(nx_, x + kGroup); ++i)
                    if (!is_far(line * nx_ + i))
                        visit(i);
    }
    /// Whether all of [x, x + count) of a line is far: a part of one group.
    bool are_far(std::size_t line, std::size_t x, std::size_t count) const
    {
        const std::size_t begin = line * nx_ + x;
        return !is_near_[line * nx_groups() + x / kGroup] ||
               codes_.is_zero(begin, begin + count);
    }

private:
    std::size_t nx_groups() const { return (nx_ + kGroup - 1) / kGroup; }

    std::size_t nx_;
    std::vector<char> is_near_;        ///< of each group whether any of it is not far
    VoxelValues<std::uint16_t> codes_; ///< 1 + the squared distance; 0: far
};

/// Takes away from a set of voxels, those that are not 0 in \p set, what is at most
/// \p reach [voxel], at most NearDistances::kFarthest, from a voxel outside of it. Beyond
/// the grid there is none.
void shrink(VoxelFlags& set, const Eigen::Vector3i& counts, int reach);

} // namespace cellwarp::core
