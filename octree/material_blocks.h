// SPDX-License-Identifier: GPL-3.0-or-later
// Material in blocks of 4 x 4 x 4 voxels, a bit a voxel, and how these hold together:
// what only asks how places are connected looks at 64 voxels at once.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/notches.h"
#include "octree/voxel_grid.h"
#include "octree/voxel_runs.h"

namespace cellwarp::core
{

/// The parts of the material inside the blocks: of one material, connected inside their
/// block, not across open sides of notches. Parts are numbered block by block. Keeps
/// references to grid and notches. Immutable once built.
class MaterialBlocks
{
public:
    static constexpr int kWidth = 4; ///< of a block [voxel]

    MaterialBlocks(const VoxelGrid& grid, const Notches& notches);

    std::size_t size() const { return parts_.size(); }
    /// The voxels of a part: bit x + 4 y + 16 z for the one at (x, y, z) in its block.
    std::uint64_t voxels(std::size_t part) const { return parts_[part].voxels; }
    /// The number of the block that a part is in: those along x follow each other.
    std::size_t block(std::size_t part) const { return parts_[part].block; }
    /// The first voxel of a block.
    Eigen::Vector3i first_voxel(std::size_t block) const
    {
        // 32 bits are divided several times as fast as 64.
        const auto number = static_cast<std::uint32_t>(block);
        const auto nx = static_cast<std::uint32_t>(counts_.x()),
                   ny = static_cast<std::uint32_t>(counts_.y());
        return kWidth * Eigen::Vector3i(static_cast<int>(number % nx),
                                        static_cast<int>(number / nx % ny),
                                        static_cast<int>(number / nx / ny));
    }
    /// The part that holds a voxel of material.
    std::size_t part_of(const Eigen::Vector3i& voxel) const;

    /// Some voxels of a block, as in voxels().
    struct Bits
    {
        std::size_t block;
        std::uint64_t voxels;
    };
    /// All of them. \pre by block, ascending; blocks may repeat
    VoxelRuns runs_of(std::span<const Bits> blocks) const;

    /// Calls visit(part) for those in the six blocks around that hold together with a
    /// part.
    template <class Visit>
    void for_each_linked(std::size_t part, Visit&& visit) const
    {
        const Eigen::Vector3i at = first_voxel(block(part)) / kWidth;
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1})
            {
                if (at[axis] + step < 0 || at[axis] + step >= counts_[axis])
                    continue;
                const std::size_t other = step < 0 ? block(part) - stride_[idx(axis)]
                                                   : block(part) + stride_[idx(axis)];
                for (std::size_t p = first_of(other);
                     p < size() && parts_[p].block == other; ++p)
                    if (step < 0 ? are_linked(p, part, axis) : are_linked(part, p, axis))
                        visit(p);
            }
    }

private:
    struct Part
    {
        std::uint64_t voxels;
        std::uint32_t block;
        std::uint8_t material;
        std::uint8_t open_axes; ///< bit k: a voxel has an open upper side along axis k
    };

    /// The first part of a block; size() without material.
    std::size_t first_of(std::size_t block) const
    {
        const std::uint32_t first = first_of_block_[block];
        return first == static_cast<std::uint32_t>(-1) ? size() : first;
    }
    void add_parts(std::size_t block);
    bool are_linked(std::size_t lower, std::size_t upper, int axis) const;

    const VoxelGrid& grid_;
    const Notches& notches_;
    Eigen::Vector3i counts_; ///< of blocks
    std::array<std::size_t, 3> stride_;
    std::vector<Part> parts_;
    VoxelNumbers<std::uint32_t> first_of_block_;
};

/// Calls visit(bit) for the bits that are set, ascending.
template <class Visit>
void for_each_bit(std::uint64_t bits, Visit&& visit)
{
    for (; bits != 0; bits &= bits - 1)
        visit(std::countr_zero(bits));
}

/// The place of a bit in its block.
inline Eigen::Vector3i place_of_bit(int bit)
{
    return {bit & 3, bit >> 2 & 3, bit >> 4};
}
inline int bit_of_place(const Eigen::Vector3i& place)
{
    return place.x() + 4 * place.y() + 16 * place.z();
}

} // namespace cellwarp::core
