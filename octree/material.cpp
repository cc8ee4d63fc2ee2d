// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/material.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "octree/distance_transform.h"
#include "octree/flood.h"
#include "octree/hollows.h"
#include "octree/point_tree.h"
#include "octree/surface_marks.h"
#include "octree/winding.h"

namespace cellwarp
{

namespace
{

/// Largest opening that is closed to find an inside, as a radius [of the diagonal].
/// The bunny's two base holes need 0.03.
constexpr double kMaxSealRadius = 0.04;

/// Above this radius of an opening [of the diagonal] hollows are nearer to the closed
/// shape than what a flood leaves (the table in README, "Wide openings").
constexpr double kWideRadius = 0.015;

/// Largest opening of a hollow, as a radius [of the diagonal]. A pot without its lid is
/// solid; the sample vase, whose rim needs 0.16, stays a shell.
constexpr double kMaxHollowRadius = 0.125;

/// A surface counts as nearly closed below this share of open edges. A soup that
/// lost every third triangle has more than half of its edges open.
constexpr double kNearlyClosed = 0.2;

/// The widest opening that is closed, as a radius [voxel].
int max_seal_radius(const GridShape& grid_shape)
{
    return std::clamp(
        static_cast<int>(kMaxSealRadius * grid_shape.size.norm() / grid_shape.voxel()), 1,
        100);
}

/// Which openings are closed where a flood needed \p seal_radius [voxel] (negative: where
/// it found no inside up to \p max_seal). Below two voxels marks are no surface.
Openings wide_openings(const GridShape& grid_shape, double seal_radius, double max_seal)
{
    const double narrowest = std::max(2.0, seal_radius < 0 ? max_seal : seal_radius);
    const double widest = kMaxHollowRadius * grid_shape.size.norm() / grid_shape.voxel();
    return {narrowest, std::max(narrowest, widest)};
}

/// Spreads the marks that bound no inside, none being within \p reach: an open sheet
/// beside a closed body must hold together as well. Lengths in voxels.
void spread_sheets(VoxelGrid& grid, const std::vector<std::uint8_t>& marks, double reach,
                   double r)
{
    std::vector<std::uint8_t> inside = grid.material();
    for (std::size_t i = 0; i < inside.size(); ++i)
        inside[i] = inside[i] && !marks[i];
    const std::vector<float> distances = squared_distances(inside, grid.counts());
    std::vector<std::uint8_t> sheet = marks;
    for (std::size_t i = 0; i < sheet.size(); ++i)
        sheet[i] = marks[i] && distances[i] > static_cast<float>(reach * reach);
    spread(grid, sheet, r);
}

} // namespace

double point_spacing(std::span<const Eigen::Vector3d> points)
{
    // The sixth neighbour: on a surface sampled at random it is about as far as
    // the widest of the gaps around a point. 2,000 points tell the median.
    constexpr std::size_t kNeighbours = 7, kProbes = 2000;
    std::vector<Eigen::Vector3d> places(points.begin(), points.end());
    const auto key = [](const Eigen::Vector3d& p)
    { return std::tuple(p.x(), p.y(), p.z()); };
    std::sort(places.begin(), places.end(),
              [&](const auto& a, const auto& b) { return key(a) < key(b); });
    places.erase(std::unique(places.begin(), places.end()), places.end());
    if (places.size() < 2)
        return 0.0;
    const PointTree tree(places);
    const std::size_t step = std::max<std::size_t>(1, places.size() / kProbes);
    std::vector<double> distances;
    std::vector<PointTree::Neighbour> near;
    for (std::size_t i = 0; i < places.size(); i += step)
    {
        tree.nearest(places[i], kNeighbours, near);
        distances.push_back(std::sqrt(near.back().distance_squared));
    }
    std::nth_element(distances.begin(),
                     distances.begin() +
                         static_cast<std::ptrdiff_t>(distances.size() / 2),
                     distances.end());
    return distances[distances.size() / 2];
}

double material_bytes(const GridShape& grid_shape)
{
    // The flood works on a grid with a border: marks, two bytes; distances, four, in a
    // sweep each; the grid itself: marks, labels and distances. Hollows, with a narrower
    // border and after the flood, take less.
    const double border = 2.0 * (max_seal_radius(grid_shape) + 2.0);
    const Eigen::Array3d inner =
        grid_shape.coarsest.cast<double>().array() * grid_shape.voxels_per_coarsest();
    return 12.0 * (inner + border).prod() + 20.0 * inner.prod();
}

Material find_material(const Shape& shape, const GridShape& grid_shape, Fill fill)
{
    Material material{VoxelGrid(grid_shape)};
    VoxelGrid& grid = material.grid;
    mark_surface(shape, grid);
    const std::vector<std::uint8_t> marks = grid.material();
    const double voxel = grid_shape.voxel();
    const bool is_cloud = shape.triangles.empty();
    if (is_cloud)
        material.spacing = point_spacing(shape.samples);
    const int max_radius = max_seal_radius(grid_shape);
    // How far apart neighbouring samples of a cloud are [voxel].
    const int reach_of_samples =
        material.spacing > 0
            ? std::clamp(static_cast<int>(std::ceil(material.spacing / voxel)), 1,
                         max_radius)
            : 0;
    if (fill == Fill::Solid)
    {
        const std::vector<Triangle> triangles = bounding_triangles(shape);
        const double open = open_edge_share(triangles);
        if (open == 0.0)
        {
            fill_by_winding(shape, triangles, grid);
            material.method = InsideMethod::Winding;
            return material;
        }
        std::vector<std::uint8_t> votes;
        if (open < kNearlyClosed)
            votes = inside_votes(shape, triangles, grid);
        const auto may_fill = [&](std::size_t i)
        { return votes.empty() || votes[i] >= 4; };
        const double radius = fill_by_flood(grid, max_radius, may_fill);
        if (radius >= 0)
        {
            material.method = votes.empty() ? InsideMethod::Flood : InsideMethod::Votes;
            material.seal_radius = radius * voxel;
            // A voxel on either side counts as well.
            material.joins_below = (2.0 * radius + 2.0) * voxel;
        }
        if (radius < 0 || radius * voxel > kWideRadius * grid_shape.size.norm())
        {
            std::vector<std::uint8_t> flooded = std::move(grid.material());
            grid.material() = marks;
            const double closed = fill_hollows(
                grid, wide_openings(grid_shape, radius, max_radius), may_fill);
            if (closed >= 0)
            {
                material.method = InsideMethod::Wrap;
                material.seal_radius = closed * voxel;
            }
            else
                grid.material() = std::move(flooded);
        }
        if (material.method != InsideMethod::None)
        {
            // How far the inside may be from the marks around it [voxel].
            const double away = material.method == InsideMethod::Wrap ? 1.0 : radius;
            if (is_cloud)
                spread_sheets(grid, marks, std::max<double>(away, reach_of_samples) + 1.0,
                              0.5 * (reach_of_samples + 1));
            const int reach =
                std::max({1, reach_of_samples, static_cast<int>(2 * radius)});
            join_fragments(grid, reach);
            if (reach_of_samples > 0)
                material.joins_below =
                    std::max(material.joins_below, (reach + 2.0) * voxel);
            return material;
        }
    }
    if (reach_of_samples > 0)
    {
        material.joins_below = (reach_of_samples + 3.0) * voxel;
        spread(grid, marks, 0.5 * (reach_of_samples + 1));
        join_fragments(grid, reach_of_samples);
    }
    return material;
}

const char* inside_name(InsideMethod method)
{
    switch (method)
    {
    case InsideMethod::Winding:
        return "winding number";
    case InsideMethod::Votes:
        return "rays";
    case InsideMethod::Flood:
        return "flood";
    case InsideMethod::Wrap:
        return "wrap";
    case InsideMethod::None:
        break;
    }
    return "none";
}

} // namespace cellwarp
