// SPDX-License-Identifier: GPL-3.0-or-later
// Along the line through the centres of a voxel column the winding number is the sum
// of the signs of the crossings below. It is not zero in overlapping parts, where
// parity would say outside. Of a surface with a few holes each ray may be wrong: the
// six rays of a voxel vote.
#include "octree/winding.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/wrap/side.h"

namespace cellwarp
{

namespace
{

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

/// Which columns of voxels along an axis are asked for; empty: all.
using Columns = std::vector<char>;

/// The number of the column at (i, j) on the two axes that follow \p axis.
std::uint64_t column_at(const VoxelGrid& grid, int axis, int i, int j)
{
    return idx(j) * idx(grid.counts()[(axis + 1) % 3]) + idx(i);
}
std::uint64_t column_of(const VoxelGrid& grid, int axis, const Eigen::Vector3i& voxel)
{
    return column_at(grid, axis, voxel[(axis + 1) % 3], voxel[(axis + 2) % 3]);
}

/// Of one triangle, added to \p found.
void add_crossings(const Shape& shape, const Triangle& t, const VoxelGrid& grid, int axis,
                   const Columns& columns, std::vector<Crossing>& found)
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
            const std::uint64_t column = column_at(grid, axis, i, j);
            if (!columns.empty() && !columns[column])
                continue;
            const double x = i + 0.5, y = j + 0.5;
            const int s0 = side(p[0], p[1], x, y), s1 = side(p[1], p[2], x, y),
                      s2 = side(p[2], p[0], x, y);
            if (s0 != s1 || s1 != s2 || s0 == 0)
                continue;
            found.push_back({column, height_at(p, h, x, y), s0});
        }
}

/// By column, then ascending.
std::vector<Crossing> crossings(const Shape& shape,
                                const std::vector<Triangle>& triangles,
                                const VoxelGrid& grid, int axis,
                                const Columns& columns = {})
{
    constexpr std::size_t kTriangles = 16384; // of one part
    std::vector<std::vector<Crossing>> of_parts((triangles.size() + kTriangles - 1) /
                                                kTriangles);
    parallel_for(
        of_parts.size(),
        [&](std::size_t part)
        {
            const std::size_t begin = part * kTriangles;
            const std::size_t end = std::min(triangles.size(), begin + kTriangles);
            for (std::size_t t = begin; t < end; ++t)
                add_crossings(shape, triangles[t], grid, axis, columns, of_parts[part]);
        });
    std::vector<Crossing> found;
    for (const std::vector<Crossing>& part : of_parts)
        found.insert(found.end(), part.begin(), part.end());
    parallel_sort(found);
    return found;
}

/// Calls \p visit(voxel index, winding number seen from below, from above) for the
/// voxels of all columns that are crossed, of one column on one thread.
template <class Visit>
void walk_columns(const std::vector<Crossing>& found, const VoxelGrid& grid, int axis,
                  Visit&& visit)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    std::vector<std::size_t> first_of; // of each column, and the end
    for (std::size_t i = 0; i < found.size(); ++i)
        if (i == 0 || found[i].column != found[i - 1].column)
            first_of.push_back(i);
    const std::size_t num_columns = first_of.size();
    first_of.push_back(found.size());
    constexpr std::size_t kColumns = 64; // of one thread
    parallel_for(num_columns, kColumns,
                 [&](std::size_t c)
                 {
                     const std::size_t end = first_of[c + 1];
                     std::size_t next = first_of[c];
                     const std::uint64_t column = found[next].column;
                     const auto across = static_cast<std::uint64_t>(grid.counts()[u]);
                     Eigen::Vector3i voxel;
                     voxel[u] = static_cast<int>(column % across);
                     voxel[v] = static_cast<int>(column / across);
                     int total = 0, below = 0;
                     for (std::size_t i = next; i < end; ++i)
                         total += found[i].sign;
                     for (int h = 0; h < grid.counts()[axis]; ++h)
                     {
                         while (next < end && found[next].height < h + 0.5)
                             below += found[next++].sign;
                         if (below == 0 && total == 0)
                         {
                             if (next == end)
                                 break;
                             // Outside up to the next crossing.
                             h = std::clamp(static_cast<int>(found[next].height - 0.5), h,
                                            grid.counts()[axis] - 1);
                         }
                         voxel[axis] = h;
                         visit(grid.index(voxel), below, total - below);
                     }
                 });
}

} // namespace

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
        columns[column_of(grid, axis, grid.coordinates(voxel))] = 1;
    const std::vector<Crossing> found = crossings(shape, triangles, grid, axis, columns);
    for (std::size_t k = 0; k < voxels.size(); ++k)
    {
        const Eigen::Vector3i at = grid.coordinates(voxels[k]);
        const std::uint64_t column = column_of(grid, axis, at);
        int below = 0;
        for (auto crossing = std::lower_bound(found.begin(), found.end(), column,
                                              [](const auto&a, std::uint64_t of)
                                              { return a.column < of; });
             crossing != found.end() && crossing->column == column &&
             crossing->height < at[axis] + 1.0;
             ++crossing)
            below += crossing->sign;
        is_inside[k] = below != 0;
    }
    return is_inside;
}

} // namespace cellwarp
