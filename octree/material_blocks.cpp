// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/material_blocks.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace cellwarp::core
{

namespace
{

/// From a voxel to the next one along each axis [bit].
constexpr std::array<int, 3> kStep = {1, 4, 16};
/// The last voxels of a block along each axis.
constexpr std::array<std::uint64_t, 3> kLast = {0x8888888888888888u, 0xf000f000f000f000u,
                                                0xffff000000000000u};

/// Bit i says whether byte i is not 0.
std::uint32_t bits_of_bytes(std::uint32_t four)
{
    const std::uint32_t ones =
        (four | ((four & 0x7f7f7f7fu) + 0x7f7f7f7fu)) >> 7 & 0x01010101u;
    return ones * 0x10204080u >> 28;
}

/// All of \p voxels that a way through open doors leads to from \p reached. \p doors: for
/// each axis the voxels from which one leads to the next voxel.
std::uint64_t connected(std::uint64_t reached, const std::array<std::uint64_t, 3>& doors)
{
    for (std::uint64_t before = 0; before != reached;)
    {
        before = reached;
        for (std::size_t axis = 0; axis < 3; ++axis)
            reached |= (reached & doors[axis]) << kStep[axis] |
                       (reached >> kStep[axis] & doors[axis]);
    }
    return reached;
}

} // namespace

MaterialBlocks::MaterialBlocks(const VoxelGrid& grid, const Notches& notches)
    : grid_(grid), notches_(notches),
      counts_((grid.counts().array() + kWidth - 1) / kWidth),
      stride_{1, idx(counts_.x()), idx(counts_.x()) * idx(counts_.y())},
      first_of_block_(stride_[2] * idx(counts_.z()))
{
    for (std::size_t block = 0; block < first_of_block_.size(); ++block)
        add_parts(block);
    parts_.shrink_to_fit();
}

void MaterialBlocks::add_parts(std::size_t block)
{
    const Eigen::Vector3i first = first_voxel(block);
    const Eigen::Vector3i width = (grid_.counts() - first).cwiseMin(kWidth);
    std::array<std::uint8_t, 64> materials{};
    std::uint64_t left = 0;
    std::array<std::uint64_t, 3> open{};
    std::uint32_t any = 0; // the bits of all materials, four voxels at once
    for (int k = 0; k < width.z(); ++k)
        for (int j = 0; j < width.y(); ++j)
        {
            const std::size_t row = grid_.index(first + Eigen::Vector3i(0, j, k));
            const std::size_t at = idx(kStep[1] * j + kStep[2] * k);
            std::memcpy(&materials[at], &grid_.material()[row], idx(width.x()));
            std::uint32_t four;
            std::memcpy(&four, &materials[at], sizeof four);
            any |= four;
            if (four == 0)
                continue;
            left |= std::uint64_t{bits_of_bytes(four)} << at;
            if (notches_.empty() ||
                notches_.open_sides().is_zero(row, row + idx(width.x())))
                continue;
            for (std::size_t i = 0; i < idx(width.x()); ++i)
                for (std::size_t axis = 0; axis < 3; ++axis)
                    if (notches_.is_open(row + i, static_cast<int>(axis)))
                        open[axis] |= std::uint64_t{1} << (at + i);
        }
    if (left == 0)
        return;
    std::array<std::uint64_t, 3> doors;
    for (std::size_t axis = 0; axis < 3; ++axis)
    {
        doors[axis] = left & left >> kStep[axis] & ~kLast[axis] & ~open[axis];
        if (any != 0x01010101u) // else all are of material 1
            for_each_bit(doors[axis],
                         [&](int bit)
                         {
                             if (materials[idx(bit)] != materials[idx(bit + kStep[axis])])
                                 doors[axis] &= ~(std::uint64_t{1} << bit);
                         });
    }
    first_of_block_.set(block, static_cast<std::uint32_t>(parts_.size()));
    while (left != 0)
    {
        const std::uint64_t voxels = connected(left & ~(left - 1), doors);
        std::uint8_t open_axes = 0;
        for (std::size_t axis = 0; axis < 3; ++axis)
            if ((voxels & open[axis]) != 0)
                open_axes |= static_cast<std::uint8_t>(1 << axis);
        parts_.push_back({voxels, static_cast<std::uint32_t>(block),
                          materials[idx(std::countr_zero(voxels))], open_axes});
        left &= ~voxels;
    }
}

std::size_t MaterialBlocks::part_of(const Eigen::Vector3i& voxel) const
{
    const Eigen::Vector3i at = voxel / kWidth;
    const std::size_t block =
        idx(at.x()) + idx(at.y()) * stride_[1] + idx(at.z()) * stride_[2];
    const int bit = bit_of_place(voxel - kWidth * at);
    std::size_t part = first_of(block);
    while ((parts_[part].voxels >> bit & 1) == 0)
        ++part;
    return part;
}

bool MaterialBlocks::are_linked(std::size_t lower, std::size_t upper, int axis) const
{
    const Part &a = parts_[lower], &b = parts_[upper];
    const int to_first = (kWidth - 1) * kStep[idx(axis)];
    std::uint64_t sides = (a.voxels & kLast[idx(axis)]) >> to_first & b.voxels;
    if (a.material != b.material)
        return false;
    if ((a.open_axes >> axis & 1) == 0)
        return sides != 0;
    bool is_held = false;
    for_each_bit(sides,
                 [&](int bit)
                 {
                     const std::size_t voxel =
                         grid_.index(first_voxel(a.block) + place_of_bit(bit + to_first));
                     is_held = is_held || !notches_.is_open(voxel, axis);
                 });
    return is_held;
}

VoxelRuns MaterialBlocks::runs_of(std::span<const Bits> blocks) const
{
    std::vector<VoxelRuns::Run> runs;
    const std::size_t nx = idx(counts_.x());
    for (std::size_t begin = 0, end = 0; begin < blocks.size(); begin = end)
    {
        while (end < blocks.size() && blocks[end].block / nx == blocks[begin].block / nx)
            ++end;
        for (int row = 0; row < 64; row += kWidth)
            for (std::size_t b = begin; b < end; ++b)
            {
                const std::uint64_t bits = blocks[b].voxels >> row & 0xf;
                if (bits == 0)
                    continue;
                const auto first = static_cast<std::uint32_t>(
                    grid_.index(first_voxel(blocks[b].block) + place_of_bit(row)));
                for_each_bit(bits,
                             [&](int bit)
                             {
                                 const std::uint32_t voxel =
                                     first + static_cast<std::uint32_t>(bit);
                                 if (!runs.empty() && runs.back().end == voxel)
                                     ++runs.back().end;
                                 else
                                     runs.push_back({voxel, voxel + 1});
                             });
            }
    }
    return VoxelRuns(std::move(runs));
}

} // namespace cellwarp::core
