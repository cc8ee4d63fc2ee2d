// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/material.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "octree/base/parallel.h"
#include "octree/base/point_tree.h"
#include "octree/fragments.h"
#include "octree/near_distances.h"
#include "octree/open_inside.h"
#include "octree/surface_marks.h"
#include "octree/touching.h"
#include "octree/winding.h"

namespace cellwarp::core
{

namespace
{

/// A surface counts as nearly closed below this share of open edges. A soup that
/// lost every third triangle has more than half of its edges open.
constexpr double kNearlyClosed = 0.2;

constexpr std::size_t kSamplesAtOnce = 4096; ///< of one thread
/// As measured: of all voxels, and of those of the flood and what comes after it [byte].
constexpr double kBytesOfVoxel = 6.0, kBytesOfFloodedVoxel = 10.0;

/// The voxels inside that have a side in common with one that is not: from outside they
/// are the nearest ones.
VoxelFlags boundary_of(const VoxelGrid& grid, const VoxelFlags& inside)
{
    VoxelFlags boundary(grid.size());
    parallel_for_each_set(inside,
                          [&](std::size_t i)
                          {
                              for_each_beside(grid.coordinates(i),
                                              [&](const Eigen::Vector3i& other)
                                              {
                                                  if (!grid.contains(other) ||
                                                      !inside[grid.index(other)])
                                                      boundary[i] = 1;
                                              });
                          });
    return boundary;
}

/// Spreads the marks that bound no inside, none being within \p reach: an open sheet
/// beside a closed body must hold together as well. Lengths in voxels.
void spread_sheets(VoxelGrid& grid, const VoxelFlags& marks, const VoxelFlags& inside,
                   double reach, double r)
{
    VoxelFlags sheet(grid.size());
    const NearDistances distances(boundary_of(grid, inside), grid.counts(), reach);
    parallel_for_each_set(marks, [&](std::size_t i) { sheet[i] = distances.is_far(i); });
    spread(grid, sheet, r);
}

/// Voxels between a surface and the inside that it bounds: how far its outer ones are
/// from the nearest one inside, also at a corner [voxel].
constexpr double kWall = 3.0;

/// The voxels of material that are not \p inside, nor near enough to it to bound it;
/// empty if there are none.
VoxelFlags sheet_voxels(const VoxelGrid& grid, const VoxelFlags& inside, double reach)
{
    const NearDistances distances(boundary_of(grid, inside), grid.counts(), reach);
    VoxelFlags is_sheet(grid.size());
    bool has_any = false;
    for_each_set(grid.material(),
                 [&](std::size_t i)
                 {
                     if (inside[i] || !distances.is_far(i))
                         return;
                     is_sheet[i] = 1;
                     has_any = true;
                 });
    return has_any ? std::move(is_sheet) : VoxelFlags();
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

double share_near(const VoxelGrid& grid)
{
    const NearDistances distances(grid.material(), grid.counts(),
                                  max_seal_radius(grid.shape()));
    std::size_t count = 0;
    const std::size_t nx = idx(grid.counts().x());
    for (std::size_t line = 0; line < grid.size() / nx; ++line)
        distances.for_each_near(line, [&](std::size_t) { ++count; });
    return static_cast<double>(count) / static_cast<double>(grid.size());
}

bool is_nearly_closed(const BoundingSurface& surface)
{
    return surface.open_edges < kNearlyClosed;
}

double material_bytes(const BoundingSurface& surface, const GridShape& grid_shape,
                      Fill fill)
{
    // Measured: a closed shape takes a byte and some bits a voxel, and 4 more where
    // leaves hold several pieces. The flood, which open surfaces need, works in larger
    // voxels where these are fine: marks, a byte; distances, two; how free a voxel is and
    // how far the flood comes, two. What it leaves is found in a grid with a border, with
    // six bytes beside them. Hollows take as much, though not everywhere.
    if (fill == Fill::Shell || surface.open_edges == 0.0)
        return kBytesOfVoxel * num_voxels(grid_shape);
    const GridShape flooded = inside_grid(grid_shape);
    const double border = 2.0 * (max_seal_radius(flooded) + 2.0);
    const Eigen::Array3d inner =
        flooded.coarsest.cast<double>().array() * flooded.voxels_per_coarsest();
    return kBytesOfFloodedVoxel * (inner + border).prod() +
           (inside_scale(grid_shape) > 1 ? kBytesOfVoxel * num_voxels(grid_shape) : 0.0);
}

namespace
{

/// Marks all that the samples touch where the material holds none of it: a speck in the
/// corner between voxels.
void hold_samples(const Shape& shape, VoxelGrid& grid)
{
    std::vector<char> is_held(shape.samples.size(), 0);
    parallel_for(is_held.size(), kSamplesAtOnce,
                 [&](std::size_t i)
                 {
                     for_each_voxel(
                         grid.touched(shape.samples[i]), [&](const Eigen::Vector3i& voxel)
                         { is_held[i] |= grid.material()[grid.index(voxel)] != 0; });
                 });
    for (std::size_t i = 0; i < is_held.size(); ++i)
        if (!is_held[i])
            for_each_voxel(grid.touched(shape.samples[i]),
                           [&](const Eigen::Vector3i& voxel)
                           { grid.material()[grid.index(voxel)] = 1; });
}

/// Of a shape that encloses nothing: a cloud's points are spread to their spacing.
void make_shell(const VoxelFlags& marks, int reach_of_samples, Material& material)
{
    if (reach_of_samples > 0)
    {
        material.joins_below = (reach_of_samples + 3.0) * material.grid.shape().voxel();
        spread(material.grid, marks, 0.5 * (reach_of_samples + 1));
        join_fragments(material.grid, reach_of_samples);
    }
    material.is_sheet = material.grid.material();
}

/// Joins what the samples leave apart, and tells the sheets from what bounds the inside.
void join_open_parts(const OpenInside& found, const VoxelFlags& marks,
                     int reach_of_samples, Material& material)
{
    VoxelGrid& grid = material.grid;
    const double voxel = grid.shape().voxel();
    material.method = found.method;
    material.seal_radius = found.seal_radius * voxel;
    const int reach =
        std::max({1, reach_of_samples, static_cast<int>(2 * found.flood_radius)});
    // A voxel on either side counts as well.
    if (found.flood_radius >= 0)
        material.joins_below = (2.0 * found.flood_radius + 2.0) * voxel;
    if (reach_of_samples > 0)
        material.joins_below = std::max(material.joins_below, (reach + 2.0) * voxel);
    // How far the inside may be from the marks around it.
    const double away = found.method == InsideMethod::Hollows ? 1.0 : found.flood_radius;
    const double wall = std::max<double>(away, reach_of_samples) + 1.0;
    const VoxelFlags inside = beyond_marks(found.is_inside, marks);
    if (reach_of_samples > 0)
        spread_sheets(grid, marks, inside, wall, 0.5 * (reach_of_samples + 1));
    join_fragments(grid, reach);
    material.is_sheet = sheet_voxels(grid, inside, std::max(wall, kWall));
}

} // namespace

Material find_material(const Shape& shape, const BoundingSurface& surface,
                       const GridShape& grid_shape, Fill fill)
{
    Material material{VoxelGrid(grid_shape)};
    VoxelGrid& grid = material.grid;
    const VoxelFlags marks = surface_marks(shape, grid);
    if (shape.is_cloud())
        material.spacing = point_spacing(shape.samples);
    // How far apart neighbouring samples of a cloud are [voxel].
    const int reach_of_samples =
        material.spacing > 0
            ? std::clamp(
                  static_cast<int>(std::ceil(material.spacing / grid_shape.voxel())), 1,
                  max_seal_radius(grid_shape))
            : 0;
    const auto settle = [&](const VoxelFlags& is_inside)
    {
        settle_material(grid, marks, is_inside);
        hold_samples(shape, grid);
    };
    if (fill == Fill::Solid)
    {
        if (surface.open_edges == 0.0)
        {
            material.method = InsideMethod::Winding;
            const VoxelFlags is_inside =
                inside_by_winding(shape, surface.triangles, grid);
            settle(is_inside);
            if (!shape.lines.empty()) // what is drawn beside it is as thick as a sheet
                material.is_sheet =
                    sheet_voxels(grid, beyond_marks(is_inside, marks), kWall);
            return material;
        }
        const OpenInside found = open_inside(
            grid, marks,
            is_nearly_closed(surface) ? inside_votes(shape, surface.triangles, grid)
                                      : VoxelFlags());
        if (found.method != InsideMethod::None)
        {
            settle(found.is_inside);
            join_open_parts(found, marks, reach_of_samples, material);
            return material;
        }
    }
    settle(VoxelFlags(grid.size()));
    make_shell(marks, reach_of_samples, material);
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
    case InsideMethod::Hollows:
        return "hollows";
    case InsideMethod::None:
        break;
    }
    return "none";
}

} // namespace cellwarp::core
