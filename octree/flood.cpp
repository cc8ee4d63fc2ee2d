// SPDX-License-Identifier: GPL-3.0-or-later
// Finds the inside of a surface that is given by marked voxels and may have holes.
//   1. Every voxel nearer than r to a mark is closed: holes narrower than 2 r let nothing
//      in.
//   2. A flood from the grid's border fills what it reaches.
//   3. What it did not reach is the inside without a layer of the thickness r, and the
//      closed voxels outside are one, too. So the flood is grown by r again, which puts
//      the border of the inside back onto the marks.
// r is the smallest radius that seals the shape: see kSealed.
#include "octree/flood.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/distance_transform.h"

namespace cellwarp
{

namespace
{

/// An inside smaller than this share of the surface voxels is a pocket between
/// marks, not an inside.
constexpr double kMinInsideShare = 0.02;

/// How much deeper than the radius that sealed it an inside is somewhere [voxel].
/// Balls around the points of a sheet enclose pockets, but only shallow ones.
constexpr double kMinDepth = 1.5;

/// The smallest radius is taken that encloses this share of the most that any does. A
/// larger one could enclose more only by closing gaps between parts.
constexpr double kSealed = 0.95;

/// A block of voxels that the flood takes in one step where nothing is near.
constexpr int kBlock = 8, kBlockVoxels = kBlock * kBlock * kBlock;
static_assert(NearDistances::kGroup % kBlock == 0);

/// A copy of the marks of a grid with a free border all around, so that a flood can come
/// from every side, in whole blocks.
struct PaddedMarks
{
    int border;
    Eigen::Vector3i counts;
    VoxelFlags marks;

    PaddedMarks(const VoxelGrid& grid, const VoxelFlags& of_grid, int width)
        : border((width + kBlock - 1) / kBlock * kBlock)
    {
        counts = (grid.counts().array() + 2 * border + kBlock - 1) / kBlock * kBlock;
        marks = VoxelFlags(idx(counts.x()) * idx(counts.y()) * idx(counts.z()));
        for (int k = 0; k < grid.counts().z(); ++k)
            for (int j = 0; j < grid.counts().y(); ++j)
            {
                const std::size_t row = grid.index(0, j, k), to = at(0, j, k);
                for_each_set(of_grid, row, row + idx(grid.counts().x()),
                             [&](std::size_t voxel)
                             { marks[to + (voxel - row)] = of_grid[voxel]; });
            }
    }
    std::size_t at(int i, int j, int k) const
    {
        return (idx(k + border) * idx(counts.y()) + idx(j + border)) * idx(counts.x()) +
               idx(i + border);
    }
};

/// A flood from the outermost layer, through faces of free voxels, for all radii in one
/// pass: widest paths, from the widest down. Blocks that are far from all marks are free
/// at every radius and are taken whole; only of the others is there a number a voxel.
class Flood
{
public:
    /// \p distances up to more than \p most; the outermost blocks are far.
    Flood(const NearDistances& distances, const Eigen::Vector3i& counts, int most)
        : counts_(counts), blocks_(counts / kBlock), most_(most), stacks_(idx(most) + 1),
          stacks_of_blocks_(idx(most) + 1)
    {
        take(distances);
        offer_block(0, most);
        for (int r = most; r >= 0; --r)
            while (!stacks_[idx(r)].empty() || !stacks_of_blocks_[idx(r)].empty())
            {
                go_on_from_blocks(r);
                go_on_from_voxels(r);
            }
    }

    /// Calls visit(reached, free, voxel) for the voxels that it does not reach at every
    /// radius at which they are free: the largest at which it does, -1 if there is none,
    /// and at which they are. visit_far(reached) for the whole blocks.
    template <class Visit, class VisitFar>
    void for_each(Visit&& visit, VisitFar&& visit_far) const
    {
        for (std::size_t block = 0; block < near_of_.size(); ++block)
            if (near_of_[block] < 0)
                visit_far(reached_block_[block]);
            else
                for_each_row(block,
                             [&](std::size_t first, std::size_t voxel)
                             {
                                 for (std::size_t i = 0; i < kBlock; ++i)
                                     if (reached_[voxel + i] < free_[voxel + i])
                                         visit(reached_[voxel + i], free_[voxel + i],
                                               first + i);
                             });
    }

    /// The voxels that it does not reach at \p radius.
    VoxelFlags dry(int radius) const
    {
        VoxelFlags dry(idx(counts_.x()) * idx(counts_.y()) * idx(counts_.z()));
        for (std::size_t block = 0; block < near_of_.size(); ++block)
            for_each_row(block,
                         [&](std::size_t first, std::size_t voxel)
                         {
                             const bool is_near = near_of_[block] >= 0;
                             for (std::size_t i = 0; i < kBlock; ++i)
                                 if ((is_near ? reached_[voxel + i]
                                              : reached_block_[block]) < radius)
                                     dry[first + i] = 1;
                         });
        return dry;
    }

private:
    /// Calls visit(first voxel in the grid, the same in the block's own numbers) for the
    /// rows of a block.
    template <class Visit>
    void for_each_row(std::size_t block, Visit&& visit) const
    {
        const std::size_t nx = idx(blocks_.x()), ny = idx(blocks_.y());
        const std::size_t i = block % nx, j = block / nx % ny, k = block / nx / ny;
        const std::size_t own =
            near_of_[block] < 0 ? 0 : idx(near_of_[block]) * kBlockVoxels;
        for (std::size_t row = 0; row < kBlock * kBlock; ++row)
            visit(((k * kBlock + row / kBlock) * idx(counts_.y()) + j * kBlock +
                   row % kBlock) *
                          idx(counts_.x()) +
                      i * kBlock,
                  own + row * kBlock);
    }

    /// Tells the blocks that are near a mark, and how free their voxels are.
    void take(const NearDistances& distances)
    {
        const std::size_t count = idx(blocks_.x()) * idx(blocks_.y()) * idx(blocks_.z());
        near_of_.assign(count, -1);
        reached_block_.assign(count, -1);
        parallel_for(count, 64,
                     [&](std::size_t block)
                     {
                         bool is_near = false;
                         const std::size_t nx = idx(counts_.x());
                         for_each_row(block,
                                      [&](std::size_t first, std::size_t) {
                                          is_near = is_near ||
                                                    !distances.are_far(
                                                        first / nx, first % nx, kBlock);
                                      });
                         near_of_[block] = is_near ? 0 : -1;
                     });
        for (std::size_t block = 0; block < count; ++block)
            if (near_of_[block] >= 0)
            {
                near_of_[block] = static_cast<std::int32_t>(near_blocks_.size());
                near_blocks_.push_back(block);
            }
        free_.resize(near_blocks_.size() * kBlockVoxels);
        reached_.assign(free_.size(), -1);
        std::vector<std::int8_t> free_at; // of each squared distance
        for (int squared = 0; squared <= most_ * most_; ++squared)
            free_at.push_back(
                static_cast<std::int8_t>(std::ceil(std::sqrt(squared)) - 1.0));
        parallel_for(near_blocks_.size(), 64,
                     [&](std::size_t near)
                     {
                         for_each_row(
                             near_blocks_[near],
                             [&](std::size_t first, std::size_t voxel)
                             {
                                 for (std::size_t i = 0; i < kBlock; ++i)
                                     free_[voxel + i] =
                                         distances.is_beyond(first + i, most_)
                                             ? static_cast<std::int8_t>(most_)
                                             : free_at[distances.squared(first + i)];
                             });
                     });
    }

    void offer_block(std::size_t block, int r)
    {
        if (reached_block_[block] >= 0)
            return;
        reached_block_[block] = static_cast<std::int8_t>(r);
        stacks_of_blocks_[idx(r)].push_back(block);
    }
    void offer(std::size_t voxel, int r)
    {
        if (reached_[voxel] >= 0)
            return;
        const int there = std::min<int>(r, free_[voxel]);
        if (there < 0)
            return;
        reached_[voxel] = static_cast<std::int8_t>(there);
        stacks_[idx(there)].push_back(voxel);
    }

    std::size_t block_step(int axis) const
    {
        const std::size_t nx = idx(blocks_.x());
        return axis == 0 ? 1 : axis == 1 ? nx : nx * idx(blocks_.y());
    }

    void go_on_from_blocks(int r)
    {
        while (!stacks_of_blocks_[idx(r)].empty())
        {
            const std::size_t block = stacks_of_blocks_[idx(r)].back();
            stacks_of_blocks_[idx(r)].pop_back();
            for (int axis = 0; axis < 3; ++axis)
            {
                const std::size_t step = block_step(axis);
                const std::size_t place = block / step % idx(blocks_[axis]);
                if (place > 0)
                    enter(block - step, axis, kBlock - 1, r);
                if (place + 1 < idx(blocks_[axis]))
                    enter(block + step, axis, 0, r);
            }
        }
    }
    /// Offers a block from the side of a far one: the layer \p at of an axis.
    void enter(std::size_t block, int axis, int at, int r)
    {
        if (near_of_[block] < 0)
            return offer_block(block, r);
        const std::size_t first = idx(near_of_[block]) * kBlockVoxels;
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        for (int j = 0; j < kBlock; ++j)
            for (int i = 0; i < kBlock; ++i)
                offer(first + idx(at << kBits * axis | i << kBits * u | j << kBits * v),
                      r);
    }

    void go_on_from_voxels(int r)
    {
        while (!stacks_[idx(r)].empty())
        {
            const std::size_t voxel = stacks_[idx(r)].back();
            stacks_[idx(r)].pop_back();
            for (int axis = 0; axis < 3; ++axis)
            {
                const std::size_t step = std::size_t{1} << kBits * axis;
                const std::size_t last = (kBlock - 1) * step, place = voxel & last;
                if (place > 0)
                    offer(voxel - step, r);
                else
                    leave(voxel | last, block_of(voxel) - block_step(axis), r);
                if (place < last)
                    offer(voxel + step, r);
                else
                    leave(voxel & ~last, block_of(voxel) + block_step(axis), r);
            }
        }
    }
    std::size_t block_of(std::size_t voxel) const
    {
        return near_blocks_[voxel / kBlockVoxels];
    }
    /// From a voxel to a neighbouring block; \p voxel has its place there.
    void leave(std::size_t voxel, std::size_t block, int r)
    {
        if (near_of_[block] < 0)
            offer_block(block, r);
        else
            offer(idx(near_of_[block]) * kBlockVoxels + voxel % kBlockVoxels, r);
    }

    static constexpr int kBits = 3;
    static_assert(kBlock == 1 << kBits);

    Eigen::Vector3i counts_, blocks_;
    int most_;
    std::vector<std::int32_t>
        near_of_; ///< of each block its number in near_blocks_, or -1
    std::vector<std::size_t> near_blocks_;
    std::vector<std::int8_t> reached_block_;  ///< -1: not, or not as a whole
    std::vector<std::int8_t> free_, reached_; ///< of the voxels of the near blocks
    std::vector<std::vector<std::size_t>> stacks_, stacks_of_blocks_; ///< of each radius
};

} // namespace

EnclosedVoxels enclosed_voxels(const VoxelGrid& grid, const VoxelFlags& marks,
                               int max_radius,
                               const std::function<bool(std::size_t)>& may_fill)
{
    EnclosedVoxels enclosed{-1.0, VoxelFlags(grid.size())};
    const int most = max_radius;
    // Far is deep enough at every radius.
    const int reach = most + static_cast<int>(std::ceil(kMinDepth));
    const PaddedMarks padded(grid, marks, reach + kBlock);
    // Of each radius: free voxels that the flood does not reach, and the deepest of them.
    std::vector<std::size_t> inside(idx(most) + 1, 0);
    std::vector<double> deepest(inside.size(), 0.0);
    const auto add = [&](int reached, int free, std::size_t count, double squared)
    {
        for (int r = reached + 1; r <= free; ++r)
        {
            inside[idx(r)] += count;
            deepest[idx(r)] = std::max(deepest[idx(r)], squared);
        }
    };
    std::optional<Flood> flood;
    {
        const NearDistances distances(padded.marks, padded.counts, reach);
        flood.emplace(distances, padded.counts, most);
        flood->for_each(
            [&](int reached, int free, std::size_t voxel) {
                add(reached, free, 1,
                    distances.is_far(voxel) ? INFINITY : distances.squared(voxel));
            },
            [&](int reached) { add(reached, most, kBlockVoxels, INFINITY); });
    }
    for (int r = 1; r <= most; ++r)
        if (const double depth = r + kMinDepth; deepest[idx(r)] < depth * depth)
            inside[idx(r)] = 0;
    const double enough =
        kSealed * static_cast<double>(*std::max_element(inside.begin(), inside.end()));
    const int best =
        static_cast<int>(std::find_if(inside.begin(), inside.end(),
                                      [&](std::size_t count)
                                      { return static_cast<double>(count) >= enough; }) -
                         inside.begin());
    std::size_t num_marks = 0;
    for_each_set(marks, [&](std::size_t) { ++num_marks; });
    if (static_cast<double>(inside[idx(best)]) <
        std::max(1.0, kMinInsideShare * static_cast<double>(num_marks)))
        return enclosed;
    VoxelFlags is_inside = flood->dry(best);
    flood.reset();
    shrink(is_inside, padded.counts, best);
    for (int k = 0; k < grid.counts().z(); ++k)
        for (int j = 0; j < grid.counts().y(); ++j)
        {
            const std::size_t row = grid.index(0, j, k), from = padded.at(0, j, k);
            for_each_set(is_inside, from, from + idx(grid.counts().x()),
                         [&](std::size_t voxel)
                         {
                             if (may_fill(row + (voxel - from)))
                                 enclosed.is_inside[row + (voxel - from)] = 1;
                         });
        }
    enclosed.radius = best;
    return enclosed;
}

} // namespace cellwarp
