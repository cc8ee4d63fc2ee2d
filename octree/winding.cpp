// SPDX-License-Identifier: GPL-3.0-or-later
// Along the line through the centres of a voxel column the winding number is the sum
// of the signs of the crossings below. It is not zero in overlapping parts, where
// parity would say outside. Of a surface with a few holes each ray may be wrong: the
// six rays of a voxel vote.
#include "octree/winding.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <numeric>
#include <tuple>
#include <utility>

#include "octree/base/parallel.h"
#include "octree/wrap/side.h"

namespace cellwarp
{

namespace
{

/// A number for a place; -0 and 0 are one place.
std::uint64_t hash_of(const Eigen::Vector3d& place)
{
    std::uint64_t hash = 0;
    for (const double x : place)
    {
        hash = (hash ^ std::bit_cast<std::uint64_t>(x + 0.0)) * 0x9e3779b97f4a7c15u;
        hash ^= hash >> 32;
    }
    return hash;
}

/// Sample numbers with coincident samples joined to the first of them.
std::vector<std::uint32_t> joined_samples(const std::vector<Eigen::Vector3d>& samples)
{
    constexpr std::uint32_t none = ~std::uint32_t{0};
    std::vector<std::uint32_t> joined(samples.size());
    // Open addressing, at most half full: a place goes behind those that have its slot.
    std::vector<std::uint32_t> first_at(std::bit_ceil(2 * samples.size() + 1), none);
    for (std::uint32_t i = 0; i < samples.size(); ++i)
        for (std::size_t slot = hash_of(samples[i]);; ++slot)
        {
            std::uint32_t& first = first_at[slot & (first_at.size() - 1)];
            if (first == none)
                first = i;
            if (first == i || samples[first] == samples[i])
            {
                joined[i] = first;
                break;
            }
        }
    return joined;
}

/// Sorts by a first number, below \p count, then each run of one number by \p less: a
/// surface has few items of each.
template <class Item, class First, class Less>
void sort_by_first(std::vector<Item>& items, std::size_t count, const First& first,
                   const Less& less)
{
    std::vector<std::size_t> begin(count + 1, 0);
    for (const Item& item : items)
        ++begin[first(item) + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<Item> sorted(items.size());
    std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
    for (const Item& item : items)
        sorted[next[first(item)]++] = item;
    items = std::move(sorted);
    constexpr std::size_t kRunsAtOnce = 4096;
    parallel_for(count, kRunsAtOnce,
                 [&](std::size_t number)
                 {
                     std::sort(items.begin() + static_cast<std::ptrdiff_t>(begin[number]),
                               items.begin() +
                                   static_cast<std::ptrdiff_t>(begin[number + 1]),
                               less);
                 });
}

/// More than any corner.
std::size_t count_of_corners(const std::vector<Triangle>& triangles)
{
    std::uint32_t most = 0;
    for (const Triangle& t : triangles)
        most = std::max({most, t[0], t[1], t[2]});
    return std::size_t{most} + 1;
}

/// A triangle with its smallest corner first, the orientation kept.
Triangle canonical(Triangle t)
{
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
}

/// Where the lines through the voxel centres along one axis cross the triangles.
struct Crossing
{
    std::uint64_t column;
    double height; ///< [voxel]
    int sign;
    bool operator<(const Crossing& other) const
    {
        return std::tuple(column, height, sign) <
               std::tuple(other.column, other.height, other.sign);
    }
};

/// Side of the point (x, y) seen along the edge a -> b: a point on the edge counts as
/// moved by an infinitely small (e, e^2), the same for all edges. With exact signs every
/// column is beside every vertex and edge, and a closed surface has as many ways in as
/// out. 0 if the edge is a point.
int side(const double* a, const double* b, double x, double y)
{
    // The order of the ends counts where signs are rounded.
    const bool swapped = std::pair(b[0], b[1]) < std::pair(a[0], a[1]);
    if (swapped)
        std::swap(a, b);
    int sign = side_of_line(a, b, x, y);
    if (sign == 0)
        sign = a[1] < b[1] ? -1 : a[1] > b[1] || a[0] < b[0] ? 1 : 0;
    return swapped ? -sign : sign;
}

/// Height at (x, y), in the triangle of corners p with heights h. Between the two edges
/// that a line along the shorter side of its projection meets: safe for needles.
double height_at(const double (&p)[3][2], const double (&h)[3], double x, double y)
{
    const auto extent = [&](int d) {
        return std::max({p[0][d], p[1][d], p[2][d]}) -
               std::min({p[0][d], p[1][d], p[2][d]});
    };
    const int along = extent(0) >= extent(1) ? 0 : 1, across = 1 - along;
    const double at = along == 0 ? x : y, place = along == 0 ? y : x;
    double ends[2], heights[2];
    int met = 0;
    for (int k = 0; k < 3; ++k)
    {
        const int next = (k + 1) % 3;
        if ((p[k][along] <= at) == (p[next][along] <= at))
            continue;
        const double t = (at - p[k][along]) / (p[next][along] - p[k][along]);
        ends[met] = p[k][across] + t * (p[next][across] - p[k][across]);
        heights[met++] = h[k] + t * (h[next] - h[k]);
    }
    if (met < 2) // the point is at the triangle's end
        return *std::max_element(h, h + 3);
    if (ends[0] == ends[1])
        return 0.5 * (heights[0] + heights[1]);
    const double s = std::clamp((place - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0);
    return heights[0] + s * (heights[1] - heights[0]);
}

std::vector<Crossing> crossings(const Shape& shape,
                                const std::vector<Triangle>& triangles,
                                const VoxelGrid& grid, int axis)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    std::vector<Crossing> found;
    for (const Triangle& t : triangles)
    {
        double p[3][2], h[3];
        for (std::size_t k = 0; k < 3; ++k)
        {
            const Eigen::Vector3d x = grid.to_voxels(shape.samples[t[k]]);
            p[k][0] = x[u];
            p[k][1] = x[v];
            h[k] = x[axis];
        }
        int low[2], high[2];
        for (int d = 0; d < 2; ++d)
        {
            const double end = grid.counts()[d == 0 ? u : v] - 1.0;
            low[d] = static_cast<int>(std::clamp(
                std::ceil(std::min({p[0][d], p[1][d], p[2][d]}) - 0.5), 0.0, end + 1));
            high[d] = static_cast<int>(std::clamp(
                std::floor(std::max({p[0][d], p[1][d], p[2][d]}) - 0.5), -1.0, end));
        }
        for (int j = low[1]; j <= high[1]; ++j)
            for (int i = low[0]; i <= high[0]; ++i)
            {
                const double x = i + 0.5, y = j + 0.5;
                const int s0 = side(p[0], p[1], x, y), s1 = side(p[1], p[2], x, y),
                          s2 = side(p[2], p[0], x, y);
                if (s0 != s1 || s1 != s2 || s0 == 0)
                    continue;
                const std::uint64_t column =
                    static_cast<std::uint64_t>(j) *
                        static_cast<std::uint64_t>(grid.counts()[u]) +
                    static_cast<std::uint64_t>(i);
                found.push_back({column, height_at(p, h, x, y), s0});
            }
    }
    std::sort(found.begin(), found.end());
    return found;
}

/// Calls \p visit(voxel index, winding number seen from below, from above) for the
/// voxels of all columns that are crossed.
template <class Visit>
void walk_columns(const std::vector<Crossing>& found, const VoxelGrid& grid, int axis,
                  Visit&& visit)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (std::size_t first = 0; first < found.size();)
    {
        std::size_t end = first;
        int total = 0;
        while (end < found.size() && found[end].column == found[first].column)
            total += found[end++].sign;
        Eigen::Vector3i voxel;
        voxel[u] = static_cast<int>(found[first].column %
                                    static_cast<std::uint64_t>(grid.counts()[u]));
        voxel[v] = static_cast<int>(found[first].column /
                                    static_cast<std::uint64_t>(grid.counts()[u]));
        int below = 0;
        std::size_t next = first;
        for (int h = 0; h < grid.counts()[axis]; ++h)
        {
            while (next < end && found[next].height < h + 0.5)
                below += found[next++].sign;
            voxel[axis] = h;
            visit(grid.index(voxel), below, total - below);
        }
        first = end;
    }
}

} // namespace

std::vector<Triangle> bounding_triangles(const Shape& shape)
{
    const std::vector<std::uint32_t> joined = joined_samples(shape.samples);
    struct Entry
    {
        Triangle corners; ///< ascending: copies of either direction are one
        std::size_t order;
        Triangle triangle;
    };
    std::vector<Entry> entries;
    entries.reserve(shape.triangles.size());
    for (const Triangle& t : shape.triangles)
    {
        const Triangle j = {joined[t[0]], joined[t[1]], joined[t[2]]};
        if (j[0] == j[1] || j[1] == j[2] || j[2] == j[0])
            continue;
        Triangle corners = j;
        std::sort(corners.begin(), corners.end());
        entries.push_back({corners, entries.size(), canonical(j)});
    }
    sort_by_first(
        entries, shape.samples.size(),
        [](const Entry& entry) { return entry.corners[0]; },
        [](const Entry& a, const Entry& b)
        { return std::tie(a.corners, a.order) < std::tie(b.corners, b.order); });
    // Of a face that is there in both directions either the second is a flaw, or both
    // are the wall between two bodies that touch: what leaves fewer edges open.
    std::vector<Triangle> first_kept, both_dropped;
    for (std::size_t i = 0; i < entries.size();)
    {
        const std::size_t first = i;
        bool has_both = false;
        for (; i < entries.size() && entries[i].corners == entries[first].corners; ++i)
            has_both = has_both || entries[i].triangle != entries[first].triangle;
        first_kept.push_back(entries[first].triangle);
        if (!has_both)
            both_dropped.push_back(entries[first].triangle);
    }
    const bool keeps_first = both_dropped.size() < first_kept.size() &&
                             open_edge_share(first_kept) < open_edge_share(both_dropped);
    std::vector<Triangle> triangles = std::move(keeps_first ? first_kept : both_dropped);
    sort_by_first(
        triangles, shape.samples.size(), [](const Triangle& t) { return t[0]; },
        std::less<Triangle>());
    return triangles;
}

double open_edge_share(const std::vector<Triangle>& triangles)
{
    if (triangles.empty())
        return 1.0;
    // Each edge as (low, high), its direction as a sign.
    struct Edge
    {
        std::uint32_t low, high;
        int sign;
    };
    std::vector<Edge> edges;
    edges.reserve(3 * triangles.size());
    for (const Triangle& t : triangles)
        for (std::size_t k = 0; k < 3; ++k)
        {
            const std::uint32_t a = t[k], b = t[(k + 1) % 3];
            edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1});
        }
    sort_by_first(
        edges, count_of_corners(triangles), [](const Edge& edge) { return edge.low; },
        [](const Edge& a, const Edge& b) { return a.high < b.high; });
    std::size_t open = 0, total = 0;
    for (std::size_t i = 0; i < edges.size(); ++total)
    {
        int balance = 0;
        const Edge& edge = edges[i];
        for (; i < edges.size() && edges[i].low == edge.low && edges[i].high == edge.high;
             ++i)
            balance += edges[i].sign;
        open += balance != 0;
    }
    return static_cast<double>(open) / static_cast<double>(total);
}

VoxelFlags inside_by_winding(const Shape& shape, const std::vector<Triangle>& triangles,
                             const VoxelGrid& grid)
{
    VoxelFlags is_inside(grid.size());
    walk_columns(crossings(shape, triangles, grid, 2), grid, 2,
                 [&](std::size_t voxel, int below, int)
                 {
                     if (below != 0)
                         is_inside[voxel] = 1;
                 });
    return is_inside;
}

VoxelFlags inside_votes(const Shape& shape, const std::vector<Triangle>& triangles,
                        const VoxelGrid& grid)
{
    VoxelFlags votes(grid.size());
    for (int axis = 0; axis < 3; ++axis)
        walk_columns(crossings(shape, triangles, grid, axis), grid, axis,
                     [&](std::size_t voxel, int below, int above)
                     {
                         if (below == 0 && above == 0)
                             return;
                         votes[voxel] = static_cast<std::uint8_t>(
                             votes[voxel] + (below != 0) + (above != 0));
                     });
    return votes;
}

} // namespace cellwarp
