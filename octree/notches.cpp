// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/notches.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/shared_marks.h"
#include "octree/winding.h"

namespace cellwarp::core
{

namespace
{

/// What is as near to a plane or a side as this meets it [voxel].
constexpr double kMeets = 1e-6;

constexpr std::size_t kMarkedAtOnce = 1024; ///< of one thread
constexpr std::size_t kVoxelsAtOnce = 1 << 16;

/// Of a voxel that has a side which triangles meet; beside bit k, which says that its
/// upper side along axis k is one.
constexpr std::uint8_t kAtSurface = 8;

/// Marks the sides of voxels that triangles meet.
class SideMarker
{
public:
    SideMarker(const VoxelGrid& grid, SharedMarks& met) : grid_(grid), met_(met) {}

    /// Corners in voxel units.
    void add(const std::array<Eigen::Vector3d, 3>& corners)
    {
        for (axis_ = 0; axis_ < 3; ++axis_)
        {
            const auto [low, high] =
                std::minmax({corners[0][axis_], corners[1][axis_], corners[2][axis_]});
            // Numbers are not negative, so that cutting off is rounding down.
            const int last =
                std::min(static_cast<int>(high + kMeets), grid_.counts()[axis_] - 1);
            for (plane_ = static_cast<int>(std::max(low - kMeets, 0.0)) + 1;
                 plane_ <= last; ++plane_)
                add_section(corners);
        }
    }

private:
    /// A place in the plane, along the next axis and the one after it.
    struct Place
    {
        double u = 0.0, v = 0.0;
    };

    /// What a plane between voxels has of a triangle: a line, or all of it.
    void add_section(const std::array<Eigen::Vector3d, 3>& corners)
    {
        const int u = (axis_ + 1) % 3, v = (axis_ + 2) % 3;
        std::array<Place, 3> places;
        std::size_t count = 0, num_corners = 0;
        for (std::size_t k = 0; k < 3; ++k)
        {
            const Eigen::Vector3d& p = corners[k];
            const Eigen::Vector3d& q = corners[(k + 1) % 3];
            const double at_p = p[axis_] - plane_, at_q = q[axis_] - plane_;
            if (std::abs(at_p) <= kMeets)
            {
                places[count++] = {p[u], p[v]};
                ++num_corners;
            }
            else if (std::abs(at_q) > kMeets && (at_p < 0.0) != (at_q < 0.0))
            {
                const double t = at_p / (at_p - at_q);
                places[count++] = {p[u] + t * (q[u] - p[u]), p[v] + t * (q[v] - p[v])};
            }
        }
        if (num_corners == 3)
            add_box(places);
        else if (count > 0)
            add_line(places[0], places[count - 1]);
    }

    /// All sides in the box around a triangle that lies in the plane.
    void add_box(const std::array<Place, 3>& places)
    {
        const auto [low, high] = std::minmax({places[0].u, places[1].u, places[2].u});
        const auto [begin, end] = std::minmax({places[0].v, places[1].v, places[2].v});
        for (int row = first_row(begin); row <= last_row(end); ++row)
            add_row(low, high, row);
    }

    void add_line(const Place& from, const Place& to)
    {
        const Place& low = from.v <= to.v ? from : to;
        const Place& high = from.v <= to.v ? to : from;
        const double slope = high.v > low.v ? (high.u - low.u) / (high.v - low.v) : 0.0;
        const auto at = [&](double height)
        {
            return height <= low.v    ? low.u
                   : height >= high.v ? high.u
                                      : low.u + slope * (height - low.v);
        };
        const int first = first_row(low.v), last = last_row(high.v);
        for (int row = first; row <= last; ++row)
        {
            const double a = row == first ? low.u : at(row);
            const double b = row == last ? high.u : at(row + 1);
            add_row(std::min(a, b), std::max(a, b), row);
        }
    }

    void add_row(double low, double high, int row)
    {
        const int u = (axis_ + 1) % 3, v = (axis_ + 2) % 3;
        Eigen::Vector3i voxel;
        voxel[v] = row;
        const int end = voxel_at(high + kMeets, u);
        for (int i = voxel_at(low - kMeets, u); i <= end; ++i)
        {
            voxel[u] = i;
            voxel[axis_] = plane_ - 1;
            met_.add(grid_.index(voxel),
                     static_cast<std::uint8_t>(kAtSurface | 1 << axis_));
            voxel[axis_] = plane_;
            met_.add(grid_.index(voxel), kAtSurface);
        }
    }

    int first_row(double v) const { return voxel_at(v - kMeets, (axis_ + 2) % 3); }
    int last_row(double v) const { return voxel_at(v + kMeets, (axis_ + 2) % 3); }
    /// The number of the voxel of a coordinate: the outermost ones in the box reach to
    /// its ends.
    int voxel_at(double x, int axis) const
    {
        const VoxelRange& box = grid_.inside_box();
        return std::clamp(static_cast<int>(std::max(x, 0.0)), box.first[axis],
                          box.last[axis]);
    }

    const VoxelGrid& grid_;
    SharedMarks& met_;
    int axis_ = 0, plane_ = 0; ///< whose sections are marked
};

VoxelFlags sides_met(const Shape& shape, const std::vector<Triangle>& triangles,
                     const VoxelGrid& grid)
{
    VoxelFlags met(grid.size());
    SharedMarks marks(met);
    const double scale = 1.0 / grid.shape().voxel();
    const auto in_voxels = [&](std::uint32_t sample) -> Eigen::Vector3d
    { return scale * (shape.samples[sample] - grid.corner()); };
    parallel_ranges(triangles.size(), kMarkedAtOnce,
                    [&](std::size_t begin, std::size_t end)
                    {
                        SideMarker marker(grid, marks);
                        for (std::size_t t = begin; t < end; ++t)
                            marker.add({in_voxels(triangles[t][0]),
                                        in_voxels(triangles[t][1]),
                                        in_voxels(triangles[t][2])});
                    });
    return met;
}

/// Of each axis the voxels that have a side there which no triangle meets, towards
/// another voxel of the same material, though triangles meet sides of both.
std::array<std::vector<std::size_t>, 3> free_sides(const VoxelGrid& grid,
                                                   const VoxelFlags& met)
{
    const std::size_t nx = idx(grid.counts().x());
    const std::array<std::size_t, 3> stride = {1, nx, nx * idx(grid.counts().y())};
    const VoxelFlags& material = grid.material();
    using Sides = std::array<std::vector<std::size_t>, 3>;
    std::vector<Sides> parts((grid.size() + kVoxelsAtOnce - 1) / kVoxelsAtOnce);
    const auto look_at = [&](std::size_t voxel, Sides& sides)
    {
        if (material[voxel] == 0)
            return;
        for (std::size_t axis = 0; axis < 3; ++axis)
        {
            // Beyond the last voxel of a row the next row begins.
            const std::size_t next = voxel + stride[axis];
            if ((met[voxel] >> axis & 1) == 0 && next < grid.size() && met[next] != 0 &&
                material[next] == material[voxel] &&
                grid.coordinates(voxel)[static_cast<int>(axis)] + 1 <
                    grid.counts()[static_cast<int>(axis)])
                sides[axis].push_back(voxel);
        }
    };
    parallel_for(parts.size(), 1,
                 [&](std::size_t part)
                 {
                     for_each_set(met, part * kVoxelsAtOnce,
                                  std::min(grid.size(), (part + 1) * kVoxelsAtOnce),
                                  [&](std::size_t voxel)
                                  { look_at(voxel, parts[part]); });
                 });
    Sides sides;
    for (const Sides& part : parts)
        for (std::size_t axis = 0; axis < 3; ++axis)
            sides[axis].insert(sides[axis].end(), part[axis].begin(), part[axis].end());
    return sides;
}

} // namespace

Notches::Notches(const VoxelGrid& grid, VoxelFlags open_sides)
    : open_sides_(std::move(open_sides))
{
    if (empty())
        return;
    is_in_box_ = VoxelFlags(grid.num_boxes());
    for_each_set(open_sides_, [&](std::size_t voxel)
                 { is_in_box_[grid.box(grid.coordinates(voxel))] = 1; });
}

Notches find_notches(const Shape& shape, const BoundingSurface& surface,
                     const VoxelGrid& grid)
{
    if (surface.open_edges > 0.0)
        return {};
    const std::array<std::vector<std::size_t>, 3> free =
        free_sides(grid, sides_met(shape, surface.triangles, grid));
    VoxelFlags open_sides;
    for (int axis = 0; axis < 3; ++axis)
    {
        const std::vector<char> is_inside =
            sides_inside(shape, surface.triangles, grid, axis, free[idx(axis)]);
        for (std::size_t k = 0; k < is_inside.size(); ++k)
        {
            if (is_inside[k])
                continue;
            if (open_sides.empty())
                open_sides = VoxelFlags(grid.size());
            open_sides[free[idx(axis)][k]] |= static_cast<std::uint8_t>(1 << axis);
        }
    }
    return Notches(grid, std::move(open_sides));
}

} // namespace cellwarp::core
