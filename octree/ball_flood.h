// SPDX-License-Identifier: GPL-3.0-or-later
// How far balls of each radius come from outside, in a grid some voxels of which are
// marked.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "octree/near_distances.h"
#include "octree/padded_marks.h"
#include "octree/voxel_grid.h"
#include "octree/voxel_values.h"

namespace cellwarp::core
{

/// A flood from outside by the middles of balls that hold no mark's middle, from voxel to
/// voxel through their faces, for all radii at once. Blocks of voxels that are far from
/// all marks are free at every radius and are taken whole; only of the others is there a
/// number a voxel.
class BallFlood
{
public:
    /// The largest radius that can be asked for [voxel]: distances are told a quarter
    /// farther.
    static constexpr int kLargest = 143;
    static_assert(1.25 * kLargest <= NearDistances::kFarthest);

    /// Of radii up to \p most [voxel], at most kLargest. Distances from the marks are
    /// told up to \p reach.
    /// \pre 0 <= most <= kLargest, most <= reach <= NearDistances::kFarthest
    BallFlood(const VoxelGrid& grid, const VoxelFlags& marks, int most, double reach);

    /// The grid with a border of one voxel at least: voxels are numbered as here.
    const PaddedMarks& lattice() const { return lattice_; }
    /// Distances from the marks.
    const NearDistances& distances() const { return distances_; }

    /// Calls visit(reached, free, voxel) for the voxels that it does not reach at every
    /// radius at which they are free: the largest at which it does, -1 if there is none,
    /// and at which they are. visit_far(reached, first voxel, count) for all blocks that
    /// are free at every radius.
    template <class Visit, class VisitFar>
    void for_each(Visit&& visit, VisitFar&& visit_far) const
    {
        for (std::size_t block = 0; block < near_of_.size(); ++block)
            if (near_of_[block] < 0)
                visit_far(reached_block_[block] - 1, first_of(block),
                          std::size_t{kBlockVoxels});
            else
                for_each_row(block,
                             [&](std::size_t first, std::size_t own)
                             {
                                 for (std::size_t i = 0; i < kBlock; ++i)
                                     if (reached_[own + i] < free_[own + i])
                                         visit(reached_[own + i] - 1, free_[own + i] - 1,
                                               first + i);
                             });
    }

    /// The voxels that it does not reach at \p radius, at most that of the flood, marks
    /// among them.
    VoxelFlags dry(int radius) const;

private:
    static constexpr int kBlock = 8, kLayer = kBlock * kBlock,
                         kBlockVoxels = kBlock * kLayer;
    static_assert(NearDistances::kGroup % kBlock == 0);

    /// The side of a block where voxels are first or last on an axis.
    struct Side
    {
        int axis;
        bool is_last;
    };
    static constexpr std::size_t kSides = 6;
    static constexpr Side side(std::size_t number)
    {
        return {static_cast<int>(number / 2), number % 2 == 1};
    }
    using Layer = std::array<std::uint8_t, kLayer>;

    /// Calls visit(first voxel in the lattice, the same in the block's own numbers) for
    /// the rows of a block.
    template <class Visit>
    void for_each_row(std::size_t block, Visit&& visit) const
    {
        const std::size_t first = first_of(block);
        const std::size_t own =
            near_of_[block] < 0 ? 0 : idx(near_of_[block]) * kBlockVoxels;
        const Eigen::Vector3i& counts = lattice_.counts();
        for (std::size_t row = 0; row < kBlock * kBlock; ++row)
            visit(first +
                      (row / kBlock * idx(counts.y()) + row % kBlock) * idx(counts.x()),
                  own + row * kBlock);
    }
    /// The voxel at the corner of a block.
    std::size_t first_of(std::size_t block) const
    {
        const std::size_t nx = idx(blocks_.x()), ny = idx(blocks_.y());
        const std::size_t i = block % nx, j = block / nx % ny, k = block / nx / ny;
        const Eigen::Vector3i& counts = lattice_.counts();
        return (k * kBlock * idx(counts.y()) + j * kBlock) * idx(counts.x()) + i * kBlock;
    }
    void find_near_blocks();
    void find_free();
    void flow();
    static void settle_near(std::uint8_t* reached, const std::uint8_t* free,
                            const std::array<Layer, kSides>& beyond);
    unsigned settle(std::size_t block);
    std::ptrdiff_t beside(std::size_t block, Side side) const;
    Layer layer(std::size_t block, Side side) const;
    Layer layer_beyond(std::size_t block, Side side) const;
    std::size_t place_of(std::size_t block, int axis) const;

    PaddedMarks lattice_;
    NearDistances distances_;
    Eigen::Vector3i blocks_;
    int most_;
    std::vector<std::int32_t>
        near_of_; ///< of each block its number in near_blocks_, or -1
    std::vector<std::size_t> near_blocks_;
    // Radii, one more than they are: 0 stands for none.
    std::vector<std::uint8_t> reached_block_;  ///< of far blocks
    std::vector<std::uint8_t> free_, reached_; ///< of the voxels of the near blocks
};

} // namespace cellwarp::core
