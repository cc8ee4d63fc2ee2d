// SPDX-License-Identifier: GPL-3.0-or-later
// Finds the inside of a surface that is given by marked voxels and may have holes.
//   1. Every voxel at most r from a mark is closed: holes narrower than 2 r let nothing
//      in.
//   2. A flood from the grid's border fills what it reaches.
//   3. What it did not reach is the inside without a layer of the thickness r, and the
//      closed voxels outside are one, too. So the flood is grown by r again, which puts
//      the border of the inside back onto the marks.
// r is the smallest radius that seals the shape: see kSealed.
#include "octree/sealed_inside.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "octree/ball_flood.h"
#include "octree/base/index.h"
#include "octree/near_distances.h"

namespace cellwarp::core
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

/// What the flood does not reach at \p radius, in a lattice whose border is wider than
/// that: balls outside of the grid reach into it.
VoxelFlags dry_in(const PaddedMarks& padded, const VoxelGrid& grid,
                  const BallFlood& flood, int radius)
{
    VoxelFlags dry(padded.marks().size());
    // Outside of the grid balls come everywhere where they fit.
    const NearDistances distances(padded.marks(), padded.counts(), radius);
    const std::size_t nx = idx(padded.counts().x());
    for (std::size_t line = 0; line < dry.size() / nx; ++line)
        distances.for_each_near(line, [&](std::size_t x) { dry[line * nx + x] = 1; });
    flood.lattice().for_each_in_grid(flood.dry(radius),
                                     [&](std::size_t, std::size_t voxel)
                                     { dry[padded.at(grid.coordinates(voxel))] = 1; });
    return dry;
}

} // namespace

SealedInside::SealedInside(const VoxelGrid& grid, const VoxelFlags& marks, int max_radius)
    : grid_(grid), marks_(marks)
{
    const int most = max_radius;
    flood_.emplace(grid, marks, most, most + std::ceil(kMinDepth));
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
    const NearDistances& distances = flood_->distances();
    flood_->for_each(
        [&](int reached, int free, std::size_t voxel)
        {
            // Far is deep enough at every radius.
            add(reached, free, 1,
                distances.is_far(voxel) ? INFINITY : distances.squared(voxel));
        },
        [&](int reached, std::size_t, std::size_t count)
        { add(reached, most, count, INFINITY); });
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
    if (static_cast<double>(inside[idx(best)]) >=
        std::max(1.0, kMinInsideShare * static_cast<double>(num_marks)))
        radius_ = best;
    else
        flood_.reset();
}

VoxelFlags SealedInside::voxels(const std::function<bool(std::size_t)>& may_fill) &&
{
    VoxelFlags is_inside(grid_.size());
    if (radius_ < 0)
        return is_inside;
    const PaddedMarks padded(grid_, marks_, radius_ + 1);
    VoxelFlags dry = dry_in(padded, grid_, *flood_, radius_);
    flood_.reset();
    shrink(dry, padded.counts(), radius_);
    padded.for_each_in_grid(dry,
                            [&](std::size_t, std::size_t voxel)
                            {
                                if (may_fill(voxel))
                                    is_inside[voxel] = 1;
                            });
    return is_inside;
}

} // namespace cellwarp::core
