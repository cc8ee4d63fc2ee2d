// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/voxel_grid.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Voxels along a coarsest leaf, at least: fewer, and the share of a leaf that is
/// material, and with it the stiffness at the surface, is known too roughly. Along a
/// finest one two are enough, its neighbours being as small.
constexpr int kMinVoxelsPerCoarsest = 4, kMinVoxelsPerLeaf = 2;

/// By how much a side may differ from a whole number of leaves and still be cut
/// into just so many [voxel]. The outermost voxels take up the difference.
constexpr double kSlack = 0.5;

/// The outermost voxels inside the box are no thinner than this [voxel]; what is left
/// over makes the next ones thicker. A sliver would make a cell of next to no volume, and
/// the place that stands for a voxel, the middle of its uncut cube, must lie inside.
constexpr double kThinnest = 0.75;

} // namespace

GridShape grid_shape(const Eigen::Vector3d& size, int across, int max_depth,
                     double max_voxel)
{
    GridShape shape;
    shape.size = size;
    shape.max_depth = max_depth;
    const double longest = size.maxCoeff();
    // A single point: one leaf of size one stands for it.
    shape.edge = longest > 0 ? longest / across : 1.0;
    const double finest = shape.edge / (1 << max_depth);
    // The tolerance keeps the count from depending on the last bit of a scale.
    const double wanted = max_voxel > 0 ? std::ceil(finest / max_voxel - 1e-9) : 0.0;
    const int least = std::max(kMinVoxelsPerLeaf, kMinVoxelsPerCoarsest >> max_depth);
    shape.voxels_per_leaf =
        static_cast<int>(std::clamp(wanted, static_cast<double>(least), 4096.0));
    for (int axis = 0; axis < 3; ++axis)
    {
        const double leaves = size[axis] / shape.edge;
        shape.coarsest[axis] = std::max(
            1, static_cast<int>(std::ceil(leaves - kSlack * shape.voxel() / shape.edge)));
    }
    if (!(longest > 0))
        shape.coarsest.setOnes();
    return shape;
}

double num_voxels(const GridShape& shape)
{
    return (shape.coarsest.cast<double>() *
            static_cast<double>(shape.voxels_per_coarsest()))
        .prod();
}

VoxelGrid::VoxelGrid(const GridShape& shape)
    : shape_(shape), counts_(shape.coarsest * shape.voxels_per_coarsest())
{
    const double voxel = shape.voxel();
    for (int axis = 0; axis < 3; ++axis)
    {
        const int n = counts_[axis];
        for (int i = 0; i < n; ++i)
            box_of_line_[idx(axis)].push_back(num_boxes_ *
                                              idx(i / shape.voxels_per_leaf));
        num_boxes_ *= idx(n / shape.voxels_per_leaf);
        const double size = shape.size[axis];
        corner_[axis] = 0.5 * (size - n * voxel);
        std::vector<double>& lines = lines_[idx(axis)];
        lines.resize(idx(n) + 1);
        for (int i = 0; i <= n; ++i)
            lines[idx(i)] = corner_[axis] + i * voxel;
        int& first = inside_box_.first[axis];
        int& last = inside_box_.last[axis];
        first = 0;
        last = n - 1;
        if (!(size > voxel))
            continue; // a flat shape keeps its voxels; anything else ends at its box
        // One or two are left where the box is hardly thicker than a voxel.
        first = std::clamp(
            static_cast<int>(std::ceil(-corner_[axis] / voxel - (1.0 - kThinnest))), 0,
            (n - 1) / 2);
        last = n - 1 - first;
        std::fill(lines.begin(), lines.begin() + first + 1, 0.0);
        std::fill(lines.begin() + last + 1, lines.end(), size);
    }
    material_ = VoxelFlags(idx(counts_.x()) * idx(counts_.y()) * idx(counts_.z()));
}

Eigen::Vector3i VoxelGrid::coordinates(std::size_t index) const
{
    const std::size_t nx = idx(counts_.x());
    const std::size_t ny = idx(counts_.y());
    return {static_cast<int>(index % nx), static_cast<int>(index / nx % ny),
            static_cast<int>(index / nx / ny)};
}

VoxelRange VoxelGrid::voxels_of_box(std::size_t box) const
{
    const int width = shape_.voxels_per_leaf;
    const std::size_t nx = idx(counts_.x() / width), ny = idx(counts_.y() / width);
    const Eigen::Vector3i at(static_cast<int>(box % nx), static_cast<int>(box / nx % ny),
                             static_cast<int>(box / nx / ny));
    return {width * at, (width * at).array() + width - 1};
}

Eigen::Vector3d VoxelGrid::to_voxels(const Eigen::Vector3d& x) const
{
    return (x - corner_) / shape_.voxel();
}

namespace
{

/// The voxel of \p box that holds a place, or the nearest one [voxel].
Eigen::Vector3i voxel_at(const Eigen::Array3d& place, const VoxelRange& box)
{
    // As numbers: they may be too large for an int.
    return place.floor()
        .max(box.first.cast<double>().array())
        .min(box.last.cast<double>().array())
        .cast<int>()
        .matrix();
}

} // namespace

Eigen::Vector3i VoxelGrid::locate(const Eigen::Vector3d& x) const
{
    return voxel_at(to_voxels(x).array(), inside_box_);
}

VoxelRange VoxelGrid::touched(const Eigen::Vector3d& x) const
{
    const Eigen::Array3d place = to_voxels(x).array();
    return {voxel_at(place - kTouch, inside_box_), voxel_at(place + kTouch, inside_box_)};
}

Eigen::Vector3d VoxelGrid::centre(const Eigen::Vector3i& v) const
{
    Eigen::Vector3d x;
    for (int axis = 0; axis < 3; ++axis)
    {
        const std::vector<double>& l = lines(axis);
        const std::size_t i = idx(v[axis]);
        x[axis] = 0.5 * (l[i] + l[i + 1]);
    }
    return x;
}

} // namespace cellwarp::core
