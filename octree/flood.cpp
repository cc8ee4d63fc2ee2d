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
#include <vector>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/union_find.h"
#include "octree/distance_transform.h"

namespace cellwarp
{

namespace
{

constexpr std::size_t kVoxelsAtOnce = 1 << 16; ///< of one thread

/// An inside smaller than this share of the surface voxels is a pocket between
/// marks, not an inside.
constexpr double kMinInsideShare = 0.02;

/// How much deeper than the radius that sealed it an inside is somewhere [voxel].
/// Balls around the points of a sheet enclose pockets, but only shallow ones.
constexpr float kMinDepth = 1.5f;

/// The smallest radius is taken that encloses this share of the most that any does. A
/// larger one could enclose more only by closing gaps between parts.
constexpr double kSealed = 0.95;

/// A copy of the marks of a grid with a free border all around, so that a flood can
/// come from every side.
struct PaddedMarks
{
    Eigen::Vector3i counts;
    int border;
    std::vector<std::uint8_t> marks;

    PaddedMarks(const VoxelGrid& grid, const std::vector<std::uint8_t>& of_grid,
                int width)
        : counts((grid.counts().array() + 2 * width).matrix()), border(width)
    {
        marks.assign(idx(counts.x()) * idx(counts.y()) * idx(counts.z()), 0);
        for (int k = 0; k < grid.counts().z(); ++k)
            for (int j = 0; j < grid.counts().y(); ++j)
                std::copy_n(&of_grid[grid.index(0, j, k)], grid.counts().x(),
                            &marks[at(0, j, k)]);
    }
    std::size_t at(int i, int j, int k) const
    {
        return (idx(k + border) * idx(counts.y()) + idx(j + border)) * idx(counts.x()) +
               idx(i + border);
    }
};

/// The largest radius in whole voxels, at most \p most, at which a voxel is free: farther
/// from every mark than that. -1 for a mark.
std::int8_t free_radius(float distance_squared, int most)
{
    const float d = std::sqrt(distance_squared);
    return static_cast<std::int8_t>(std::min<float>(std::ceil(d) - 1.0f, most));
}

/// Calls \p act with the voxels of the outermost layer.
template <class Act>
void for_outermost(const Eigen::Vector3i& counts, Act&& act)
{
    const std::size_t nx = idx(counts.x()), ny = idx(counts.y()), nz = idx(counts.z());
    for (std::size_t k = 0; k < nz; ++k)
        for (std::size_t j = 0; j < ny; ++j)
        {
            const bool is_row = k == 0 || k + 1 == nz || j == 0 || j + 1 == ny;
            for (std::size_t i = 0; i < nx; i += is_row ? 1 : nx - 1)
                act((k * ny + j) * nx + i);
        }
}

/// For every voxel the largest radius at which a flood from the outermost layer, through
/// faces of free voxels, reaches it; -1 if none does. One pass for all radii: widest
/// paths, from the widest down. \p free: the radius of each voxel, which is \p most in
/// the two outermost layers.
std::vector<std::int8_t> flooded(const std::vector<std::int8_t>& free, int most,
                                 const Eigen::Vector3i& counts)
{
    std::vector<std::int8_t> reached(free.size(), -1);
    const std::ptrdiff_t step[3] = {1, counts.x(),
                                    static_cast<std::ptrdiff_t>(counts.x()) * counts.y()};
    std::vector<std::vector<std::size_t>> stacks(idx(most) + 1);
    // The outermost layer is reached from the beginning, and ends the flood: inside of it
    // every voxel has all of its neighbours.
    for_outermost(counts, [&](std::size_t voxel)
                  { reached[voxel] = static_cast<std::int8_t>(most); });
    const std::size_t first = idx(step[0] + step[1] + step[2]);
    reached[first] = static_cast<std::int8_t>(most);
    stacks.back().push_back(first);
    for (int r = most; r >= 0; --r)
        while (!stacks[idx(r)].empty())
        {
            const std::size_t voxel = stacks[idx(r)].back();
            stacks[idx(r)].pop_back();
            for (const std::ptrdiff_t along : step)
                for (const std::ptrdiff_t way : {-along, along})
                {
                    const std::size_t next =
                        idx(static_cast<std::ptrdiff_t>(voxel) + way);
                    if (reached[next] >= 0)
                        continue;
                    const int there = std::min<int>(r, free[next]);
                    if (there < 0)
                        continue;
                    reached[next] = static_cast<std::int8_t>(there);
                    stacks[idx(there)].push_back(next);
                }
        }
    return reached;
}

} // namespace

EnclosedVoxels enclosed_voxels(const VoxelGrid& grid,
                               const std::vector<std::uint8_t>& marks, int max_radius,
                               const std::function<bool(std::size_t)>& may_fill)
{
    EnclosedVoxels enclosed{-1.0, std::vector<std::uint8_t>(grid.size(), 0)};
    const int most = max_radius;
    const PaddedMarks padded(grid, marks, most + 2);
    std::vector<std::int8_t> reached;
    // Of each radius: free voxels that the flood does not reach, and the deepest of them.
    std::vector<std::size_t> inside(idx(most) + 1, 0);
    std::vector<float> deepest(inside.size(), 0.0f);
    {
        const std::vector<float> distances =
            squared_distances(padded.marks, padded.counts);
        std::vector<std::int8_t> free(distances.size());
        parallel_for(free.size(), kVoxelsAtOnce,
                     [&](std::size_t i) { free[i] = free_radius(distances[i], most); });
        reached = flooded(free, most, padded.counts);
        for (std::size_t i = 0; i < reached.size(); ++i)
            for (int r = reached[i] + 1; r <= free[i]; ++r)
            {
                const std::size_t at = idx(r);
                ++inside[at];
                deepest[at] = std::max(deepest[at], distances[i]);
            }
    }
    for (int r = 1; r <= most; ++r)
        if (const float depth = static_cast<float>(r) + kMinDepth;
            deepest[idx(r)] < depth * depth)
            inside[idx(r)] = 0;
    const double enough =
        kSealed * static_cast<double>(*std::max_element(inside.begin(), inside.end()));
    const int best =
        static_cast<int>(std::find_if(inside.begin(), inside.end(),
                                      [&](std::size_t count)
                                      { return static_cast<double>(count) >= enough; }) -
                         inside.begin());
    const double num_marks = static_cast<double>(std::count_if(
        marks.begin(), marks.end(), [](std::uint8_t mark) { return mark != 0; }));
    if (static_cast<double>(inside[idx(best)]) <
        std::max(1.0, kMinInsideShare * num_marks))
        return enclosed;
    std::vector<std::uint8_t> outside(reached.size());
    for (std::size_t i = 0; i < reached.size(); ++i)
        outside[i] = reached[i] >= best;
    const std::vector<float> distances = squared_distances(outside, padded.counts);
    const float r_squared = static_cast<float>(best * best);
    for (int k = 0; k < grid.counts().z(); ++k)
        for (int j = 0; j < grid.counts().y(); ++j)
            for (int i = 0; i < grid.counts().x(); ++i)
            {
                const std::size_t voxel = grid.index(i, j, k);
                enclosed.is_inside[voxel] =
                    distances[padded.at(i, j, k)] > r_squared && may_fill(voxel);
            }
    enclosed.radius = best;
    return enclosed;
}

void spread(VoxelGrid& grid, const std::vector<std::uint8_t>& marks, double r)
{
    const std::vector<float> distances = squared_distances(marks, grid.counts());
    for_each_voxel(grid.inside_box(),
                   [&](const Eigen::Vector3i& voxel)
                   {
                       const std::size_t i = grid.index(voxel);
                       if (distances[i] <= static_cast<float>(r * r))
                           grid.material()[i] = 1;
                   });
}

void join_fragments(VoxelGrid& grid, int reach)
{
    std::vector<std::uint8_t>& material = grid.material();
    constexpr std::int32_t kFree = -1;
    std::vector<std::int32_t> part(grid.size(), kFree);
    const auto for_neighbours = [&](std::size_t voxel, auto&& visit)
    {
        const Eigen::Vector3i place = grid.coordinates(voxel);
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1})
            {
                Eigen::Vector3i other = place;
                other[axis] += step;
                if (grid.inside_box().contains(other))
                    visit(grid.index(other));
            }
    };
    std::int32_t num_parts = 0;
    std::vector<std::size_t> front;
    for (std::size_t seed = 0; seed < grid.size(); ++seed)
    {
        if (!material[seed] || part[seed] != kFree)
            continue;
        part[seed] = num_parts;
        std::vector<std::size_t> stack = {seed};
        while (!stack.empty())
        {
            const std::size_t voxel = stack.back();
            stack.pop_back();
            front.push_back(voxel);
            for_neighbours(voxel,
                           [&](std::size_t other)
                           {
                               if (material[other] && part[other] == kFree)
                               {
                                   part[other] = num_parts;
                                   stack.push_back(other);
                               }
                           });
        }
        ++num_parts;
    }
    if (num_parts < 2)
        return;
    // All parts grow at once; where two fronts meet there is a link, shortest first.
    struct Link
    {
        int length;
        std::size_t a, b;
    };
    std::vector<Link> links;
    std::vector<std::size_t> from(grid.size());
    for (const std::size_t voxel : front)
        from[voxel] = voxel;
    std::sort(front.begin(), front.end());
    for (int distance = 0; distance <= reach / 2 && !front.empty(); ++distance)
    {
        std::vector<std::size_t> next;
        for (const std::size_t voxel : front)
            for_neighbours(voxel,
                           [&](std::size_t other)
                           {
                               if (part[other] == kFree)
                               {
                                   part[other] = part[voxel];
                                   from[other] = voxel;
                                   next.push_back(other);
                               }
                               else if (part[other] != part[voxel])
                                   links.push_back({2 * distance, voxel, other});
                           });
        front = std::move(next);
    }
    std::stable_sort(links.begin(), links.end(),
                     [](const Link& a, const Link& b) { return a.length < b.length; });
    UnionFind joined(idx(num_parts));
    for (const Link& link : links)
    {
        if (!joined.join(part[link.a], part[link.b]))
            continue;
        for (std::size_t voxel : {link.a, link.b})
            for (; !material[voxel]; voxel = from[voxel])
                material[voxel] = 1;
    }
}

} // namespace cellwarp
