// SPDX-License-Identifier: GPL-3.0-or-later
// Points on the boundary of material, evenly spread, with the direction that leads out
// there: for telling whether one part has come into another one.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "octree/base/point_tree.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// The middle of a voxel that has one beside it that is not of the same material.
struct BoundaryPoint
{
    Eigen::Vector3i voxel;
    Eigen::Vector3d place;
    Eigen::Vector3d outward; ///< of length 1; zero in a film, where both ways lead out
};

/// One point of every block of 2 x 2 x 2 voxels that has any. Immutable once built.
class BoundaryPoints
{
public:
    /// \p flat_axis: across the plane of a flat shape, in which all directions are then;
    /// -1: it has none.
    explicit BoundaryPoints(const VoxelGrid& grid, int flat_axis = -1);

    const std::vector<BoundaryPoint>& all() const { return all_; }
    /// The area of the boundary that a point stands for, about [length^2].
    double area() const { return area_; }
    /// The nearest one from which a direction leads out and that \p accepts; null: none
    /// of the nearest few is.
    const BoundaryPoint*
    nearest(const Eigen::Vector3d& x,
            const std::function<bool(const BoundaryPoint&)>& accepts) const;

private:
    std::vector<BoundaryPoint> all_;
    double area_;
    std::vector<std::size_t> with_direction_;
    std::optional<PointTree> tree_; ///< of those
};

} // namespace cellwarp::core
