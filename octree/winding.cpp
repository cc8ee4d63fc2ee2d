// SPDX-License-Identifier: GPL-3.0-or-later
// Along the line through the centres of a voxel column the winding number is the sum
// of the signs of the crossings below. It is not zero in overlapping parts, where
// parity would say outside. Of a surface with a few holes each ray may be wrong: the
// six rays of a voxel vote.
#include "octree/winding.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/wrap/side.h"

namespace cellwarp::core
{

/// [VanOosterom83]
double winding_number(const Shape& shape, const std::vector<Triangle>& triangles,
                      const Eigen::Vector3d& x)
{
    double angle = 0.0;
    for (const Triangle& t : triangles)
    {
        const Eigen::Vector3d a = shape.samples[t[0]] - x, b = shape.samples[t[1]] - x,
                              c = shape.samples[t[2]] - x;
        const double la = a.norm(), lb = b.norm(), lc = c.norm();
        angle += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc +
                                                         b.dot(c) * la + c.dot(a) * lb);
    }
    return angle / (4.0 * std::numbers::pi);
}

namespace
{

/// Where the line through the voxel centres of a column crosses a triangle. A column
/// along an axis has a place on each of the two axes that follow it: (u, v).
struct Crossing
{
    int u;
    int sign;
    double height; ///< [voxel]
    bool operator<(const Crossing& other) const
    {
        return std::tuple(u, height, sign) <
               std::tuple(other.u, other.height, other.sign);
    }
};

/// Of all columns, line by line: a line holds the columns of one v, and what it has is
/// ascending.
struct Crossings
{
    std::vector<std::size_t> first; ///< of each v, and the end
    std::vector<Crossing> all;

    std::size_t num_lines() const { return first.size() - 1; }
    std::span<const Crossing> of_line(std::size_t v) const
    {
        return std::span(all).subspan(first[v], first[v + 1] - first[v]);
    }
    /// Calls visit(u, crossings) for the columns of this v that are crossed.
    template <class Visit>
    void for_each_column(std::size_t v, Visit&& visit) const
    {
        for (std::span<const Crossing> left = of_line(v); !left.empty();)
        {
            std::size_t count = 1;
            while (count < left.size() && left[count].u == left[0].u)
                ++count;
            visit(left[0].u, left.first(count));
            left = left.subspan(count);
        }
    }
    std::span<const Crossing> of_column(int u, int v) const
    {
        const std::span<const Crossing> line = of_line(idx(v));
        const auto [from, to] = std::equal_range(
            line.begin(), line.end(), Crossing{u, 0, 0.0},
            [](const Crossing& a, const Crossing& b) { return a.u < b.u; });
        return {from, to};
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

/// Which columns along an axis are asked for; empty: all. In the order of column_at().
using Columns = std::vector<char>;

std::size_t column_at(const VoxelGrid& grid, int axis, int u, int v)
{
    return idx(v) * idx(grid.counts()[(axis + 1) % 3]) + idx(u);
}

/// Calls visit(v, crossing) for those of one triangle.
template <class Visit>
void for_each_crossing(const Shape& shape, const Triangle& t, const VoxelGrid& grid,
                       int axis, const Columns& columns, Visit&& visit)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
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
            if (!columns.empty() && !columns[column_at(grid, axis, i, j)])
                continue;
            const double x = i + 0.5, y = j + 0.5;
            const int sign = side(p[0], p[1], x, y);
            if (sign != 0 && side(p[1], p[2], x, y) == sign &&
                side(p[2], p[0], x, y) == sign)
                visit(j, Crossing{i, sign, height_at(p, h, x, y)});
        }
}

Crossings crossings(const Shape& shape, const std::vector<Triangle>& triangles,
                    const VoxelGrid& grid, int axis, const Columns& columns = {})
{
    constexpr std::size_t kTriangles = 1024; // of one part
    std::vector<std::vector<std::pair<int, Crossing>>> parts(
        (triangles.size() + kTriangles - 1) / kTriangles);
    parallel_for(parts.size(), 1,
                 [&](std::size_t part)
                 {
                     const std::size_t begin = part * kTriangles;
                     const std::size_t end =
                         std::min(triangles.size(), begin + kTriangles);
                     for (std::size_t t = begin; t < end; ++t)
                         for_each_crossing(shape, triangles[t], grid, axis, columns,
                                           [&](int v, const Crossing& crossing)
                                           { parts[part].emplace_back(v, crossing); });
                 });
    // Sorted by v through a count of each, then each v by itself.
    Crossings found;
    std::vector<std::size_t>& first = found.first;
    first.resize(idx(grid.counts()[(axis + 2) % 3]) + 1, 0);
    for (const auto& part : parts)
        for (const auto& [v, crossing] : part)
            ++first[idx(v) + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    found.all.resize(first.back());
    std::vector<std::size_t> next = first;
    for (const auto& part : parts)
        for (const auto& [v, crossing] : part)
            found.all[next[idx(v)]++] = crossing;
    parallel_for(found.num_lines(), 1,
                 [&](std::size_t v)
                 {
                     std::sort(found.all.begin() + static_cast<std::ptrdiff_t>(first[v]),
                               found.all.begin() +
                                   static_cast<std::ptrdiff_t>(first[v + 1]));
                 });
    return found;
}

/// The first voxel of a column whose centre is above this height.
int first_above(double height, int count)
{
    return static_cast<int>(
        std::clamp(std::floor(height - 0.5) + 1.0, 0.0, static_cast<double>(count)));
}

} // namespace

VoxelFlags inside_by_winding(const Shape& shape, const std::vector<Triangle>& triangles,
                             const VoxelGrid& grid)
{
    VoxelFlags is_inside(grid.size());
    // Along x, where the voxels of a column follow each other in memory.
    const Crossings found = crossings(shape, triangles, grid, 0);
    const int nx = grid.counts().x();
    const auto fill = [&](std::uint8_t* row, std::span<const Crossing> column)
    {
        int below = 0, begin = 0; // the first voxel with this number below
        for (const Crossing& crossing : column)
        {
            const int next = first_above(crossing.height, nx);
            if (below != 0)
                std::fill(row + begin, row + next, std::uint8_t{1});
            begin = next;
            below += crossing.sign;
        }
    };
    parallel_for(found.num_lines(), 1,
                 [&](std::size_t v)
                 {
                     found.for_each_column(
                         v,
                         [&](int u, std::span<const Crossing> column) {
                             fill(is_inside.data() +
                                      grid.index(0, u, static_cast<int>(v)),
                                  column);
                         });
                 });
    return is_inside;
}

VoxelFlags inside_votes(const Shape& shape, const std::vector<Triangle>& triangles,
                        const VoxelGrid& grid)
{
    VoxelFlags votes(grid.size());
    for (int axis = 0; axis < 3; ++axis)
    {
        const Crossings found = crossings(shape, triangles, grid, axis);
        const int count = grid.counts()[axis];
        const auto vote_in = [&](Eigen::Vector3i voxel, std::span<const Crossing> column)
        {
            int below = 0, above = 0;
            for (const Crossing& crossing : column)
                above += crossing.sign;
            const auto vote_up_to = [&](int end)
            {
                const auto vote = static_cast<std::uint8_t>((below != 0) + (above != 0));
                if (vote == 0)
                    voxel[axis] = end;
                for (; voxel[axis] < end; ++voxel[axis])
                {
                    std::uint8_t& of = votes[grid.index(voxel)];
                    of = static_cast<std::uint8_t>(of + vote);
                }
            };
            for (const Crossing& crossing : column)
            {
                vote_up_to(first_above(crossing.height, count));
                below += crossing.sign;
                above -= crossing.sign;
            }
            vote_up_to(count);
        };
        parallel_for(found.num_lines(), 1,
                     [&](std::size_t v)
                     {
                         found.for_each_column(
                             v,
                             [&](int u, std::span<const Crossing> column)
                             {
                                 Eigen::Vector3i first = Eigen::Vector3i::Zero();
                                 first[(axis + 1) % 3] = u;
                                 first[(axis + 2) % 3] = static_cast<int>(v);
                                 vote_in(first, column);
                             });
                     });
    }
    return votes;
}

std::vector<char> sides_inside(const Shape& shape, const std::vector<Triangle>& triangles,
                               const VoxelGrid& grid, int axis,
                               const std::vector<std::size_t>& voxels)
{
    std::vector<char> is_inside(voxels.size(), 0);
    if (voxels.empty())
        return is_inside;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    Columns columns(idx(grid.counts()[u]) * idx(grid.counts()[v]), 0);
    for (const std::size_t voxel : voxels)
    {
        const Eigen::Vector3i at = grid.coordinates(voxel);
        columns[column_at(grid, axis, at[u], at[v])] = 1;
    }
    const Crossings found = crossings(shape, triangles, grid, axis, columns);
    for (std::size_t k = 0; k < voxels.size(); ++k)
    {
        const Eigen::Vector3i at = grid.coordinates(voxels[k]);
        int below = 0;
        for (const Crossing& crossing : found.of_column(at[u], at[v]))
            if (crossing.height < at[axis] + 1.0)
                below += crossing.sign;
        is_inside[k] = below != 0;
    }
    return is_inside;
}

} // namespace cellwarp::core
