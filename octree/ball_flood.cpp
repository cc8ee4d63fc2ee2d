// SPDX-License-Identifier: GPL-3.0-or-later
// The largest radius at which the flood reaches a voxel is the largest, over all ways to
// it, of the least radius at which a voxel on the way is free. So it is the least
// solution of: reached = the smaller of free and the largest that is reached beside it.
// Beyond the lattice all is reached: whoever leaves it straight on moves away from all
// marks, which are within, so that a ball that fits into an outermost voxel comes from
// outside.
//
// Blocks are settled one by one: what is reached goes through the block along each axis,
// back and forth, until nothing rises. Where its outermost layer rose the block beyond is
// settled again. There is one least solution, whatever the order; blocks are coloured as
// a chess board, and all of one colour at once read only the layers of the other.
#include "octree/ball_flood.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

BallFlood::BallFlood(const VoxelGrid& grid, const VoxelFlags& marks, int most,
                     double reach)
    : lattice_(grid, marks, 1, kBlock),
      distances_(lattice_.marks(), lattice_.counts(), reach),
      blocks_(lattice_.counts() / kBlock), most_(most)
{
    assert(0 <= most && most <= kLargest && most <= reach &&
           reach <= NearDistances::kFarthest);
    find_near_blocks();
    find_free();
    flow();
}

VoxelFlags BallFlood::dry(int radius) const
{
    assert(radius <= most_);
    VoxelFlags dry(lattice_.marks().size());
    for (std::size_t block = 0; block < near_of_.size(); ++block)
        for_each_row(block,
                     [&](std::size_t first, std::size_t own)
                     {
                         const bool is_near = near_of_[block] >= 0;
                         for (std::size_t i = 0; i < kBlock; ++i)
                             if ((is_near ? reached_[own + i] : reached_block_[block]) <=
                                 radius)
                                 dry[first + i] = 1;
                     });
    return dry;
}

void BallFlood::find_near_blocks()
{
    const std::size_t count = idx(blocks_.x()) * idx(blocks_.y()) * idx(blocks_.z());
    near_of_.assign(count, -1);
    reached_block_.assign(count, 0);
    parallel_for(count, 64,
                 [&](std::size_t block)
                 {
                     bool is_near = false;
                     const std::size_t nx = idx(lattice_.counts().x());
                     for_each_row(block,
                                  [&](std::size_t first, std::size_t) {
                                      is_near = is_near ||
                                                !distances_.are_far(first / nx,
                                                                    first % nx, kBlock);
                                  });
                     near_of_[block] = is_near ? 0 : -1;
                 });
    for (std::size_t block = 0; block < count; ++block)
        if (near_of_[block] >= 0)
        {
            near_of_[block] = static_cast<std::int32_t>(near_blocks_.size());
            near_blocks_.push_back(block);
        }
}

void BallFlood::find_free()
{
    free_.resize(near_blocks_.size() * kBlockVoxels);
    reached_.assign(free_.size(), 0);
    std::vector<std::uint8_t> free_at; // of each squared distance
    for (int squared = 0; squared <= most_ * most_; ++squared)
        free_at.push_back(static_cast<std::uint8_t>(std::ceil(std::sqrt(squared))));
    parallel_for(near_blocks_.size(), 64,
                 [&](std::size_t near)
                 {
                     for_each_row(
                         near_blocks_[near],
                         [&](std::size_t first, std::size_t own)
                         {
                             for (std::size_t i = 0; i < kBlock; ++i)
                                 free_[own + i] =
                                     distances_.is_beyond(first + i, most_)
                                         ? static_cast<std::uint8_t>(most_ + 1)
                                         : free_at[distances_.squared(first + i)];
                         });
                 });
}

/// The number of a block on an axis.
std::size_t BallFlood::place_of(std::size_t block, int axis) const
{
    const std::size_t nx = idx(blocks_.x()), ny = idx(blocks_.y());
    return axis == 0 ? block % nx : axis == 1 ? block / nx % ny : block / nx / ny;
}

/// The block beyond a side, or -1: there the lattice ends.
std::ptrdiff_t BallFlood::beside(std::size_t block, Side side) const
{
    const std::size_t at = place_of(block, side.axis);
    if (at == (side.is_last ? idx(blocks_[side.axis]) - 1 : 0))
        return -1;
    const int nx = blocks_.x();
    const std::ptrdiff_t step = side.axis == 0   ? 1
                                : side.axis == 1 ? nx
                                                 : std::ptrdiff_t{nx} * blocks_.y();
    return static_cast<std::ptrdiff_t>(block) + (side.is_last ? step : -step);
}

/// What is reached in the outermost voxels at a side, by y and x, by z and x, or by z and
/// y.
BallFlood::Layer BallFlood::layer(std::size_t block, Side side) const
{
    Layer layer;
    if (near_of_[block] < 0)
    {
        layer.fill(reached_block_[block]);
        return layer;
    }
    const std::uint8_t* const of =
        reached_.data() + idx(near_of_[block]) * std::size_t{kBlockVoxels};
    const std::size_t at = side.is_last ? kBlock - 1 : 0;
    for (std::size_t v = 0; v < kBlock; ++v)
        for (std::size_t u = 0; u < kBlock; ++u)
            layer[v * kBlock + u] = of[side.axis == 0   ? (v * kBlock + u) * kBlock + at
                                       : side.axis == 1 ? v * kLayer + at * kBlock + u
                                                        : at * kLayer + v * kBlock + u];
    return layer;
}

BallFlood::Layer BallFlood::layer_beyond(std::size_t block, Side side) const
{
    if (const std::ptrdiff_t beyond = beside(block, side); beyond >= 0)
        return layer(static_cast<std::size_t>(beyond), {side.axis, !side.is_last});
    Layer layer;
    layer.fill(static_cast<std::uint8_t>(most_ + 1));
    return layer;
}

namespace
{

/// From one voxel of each of some lines to the next one.
template <int Count>
void go_on(std::uint8_t* to, const std::uint8_t* from, const std::uint8_t* free)
{
    for (int i = 0; i < Count; ++i)
        to[i] = std::max(to[i], std::min(free[i], from[i]));
}

/// Through \p Layers that are \p Step apart, each of \p Count voxels side by side: forth
/// from \p before and back from \p after.
template <int Layers, int Step, int Count>
void go_both_ways(std::uint8_t* reached, const std::uint8_t* free,
                  const std::uint8_t* before, const std::uint8_t* after)
{
    const std::uint8_t* from = before;
    for (int k = 0; k < Layers; ++k)
    {
        go_on<Count>(reached + k * Step, from, free + k * Step);
        from = reached + k * Step;
    }
    from = after;
    for (int k = Layers; k-- > 0;)
    {
        go_on<Count>(reached + k * Step, from, free + k * Step);
        from = reached + k * Step;
    }
}

} // namespace

/// What is reached in a block that is not far, from the layers beyond its sides.
void BallFlood::settle_near(std::uint8_t* reached, const std::uint8_t* free,
                            const std::array<Layer, kSides>& beyond)
{
    std::array<std::uint8_t, kBlockVoxels> last;
    do
    {
        std::copy_n(reached, kBlockVoxels, last.begin());
        for (int row = 0; row < kLayer; ++row)
            go_both_ways<kBlock, 1, 1>(reached + row * kBlock, free + row * kBlock,
                                       &beyond[0][idx(row)], &beyond[1][idx(row)]);
        for (int plane = 0; plane < kBlock; ++plane)
            go_both_ways<kBlock, kBlock, kBlock>(
                reached + plane * kLayer, free + plane * kLayer,
                &beyond[2][idx(plane * kBlock)], &beyond[3][idx(plane * kBlock)]);
        go_both_ways<kBlock, kLayer, kLayer>(reached, free, beyond[4].data(),
                                             beyond[5].data());
    } while (!std::equal(last.begin(), last.end(), reached));
}

/// Returns of each side, as a bit, whether anything rose there.
unsigned BallFlood::settle(std::size_t block)
{
    std::array<Layer, kSides> beyond, before;
    for (std::size_t s = 0; s < kSides; ++s)
        beyond[s] = layer_beyond(block, side(s));
    if (near_of_[block] < 0)
    {
        std::uint8_t& reached = reached_block_[block];
        const std::uint8_t old = reached;
        for (const Layer& layer : beyond)
            reached = std::max(reached, *std::max_element(layer.begin(), layer.end()));
        return reached > old ? (1u << kSides) - 1 : 0;
    }
    for (std::size_t s = 0; s < kSides; ++s)
        before[s] = layer(block, side(s));
    const std::size_t own = idx(near_of_[block]) * std::size_t{kBlockVoxels};
    settle_near(reached_.data() + own, free_.data() + own, beyond);
    unsigned risen = 0;
    for (std::size_t s = 0; s < kSides; ++s)
        risen |= unsigned{layer(block, side(s)) != before[s]} << s;
    return risen;
}

void BallFlood::flow()
{
    const auto colour = [&](std::size_t block)
    { return (place_of(block, 0) + place_of(block, 1) + place_of(block, 2)) % 2; };
    std::array<std::vector<std::size_t>, 2> waiting; // of each colour
    std::vector<char> waits(near_of_.size(), 0);
    for (std::size_t block = 0; block < near_of_.size(); ++block)
        for (std::size_t s = 0; s < kSides; ++s)
            if (!waits[block] && beside(block, side(s)) < 0)
            {
                waits[block] = 1;
                waiting[colour(block)].push_back(block);
            }
    std::vector<std::size_t> now;
    std::vector<unsigned> risen;
    constexpr std::size_t kGrain = 8;
    for (std::size_t c = 0; !waiting[0].empty() || !waiting[1].empty(); c = 1 - c)
    {
        now.clear();
        now.swap(waiting[c]);
        risen.resize(now.size());
        parallel_for(now.size(), kGrain,
                     [&](std::size_t k) { risen[k] = settle(now[k]); });
        for (const std::size_t block : now)
            waits[block] = 0;
        for (std::size_t k = 0; k < now.size(); ++k)
            for (std::size_t s = 0; s < kSides; ++s)
            {
                if (!(risen[k] >> s & 1))
                    continue;
                const std::ptrdiff_t next = beside(now[k], side(s));
                if (next < 0 || waits[static_cast<std::size_t>(next)])
                    continue;
                waits[static_cast<std::size_t>(next)] = 1;
                waiting[1 - c].push_back(static_cast<std::size_t>(next));
            }
    }
}

} // namespace cellwarp::core
