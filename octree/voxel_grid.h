// SPDX-License-Identifier: GPL-3.0-or-later
// The fine grid on which a shape's material is found. Voxels only say where
// material is; what moves are the cells made of them.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/voxel_values.h"

namespace cellwarp::core
{

/// How the box of a shape is cut into leaves and voxels. All leaves are cubes, which may
/// reach beyond the box; voxels are cubes but for the outermost layer, which ends at the
/// box: it is 0.75 to 1.75 of them thick, at least half of one where the box is that
/// thin.
struct GridShape
{
    Eigen::Vector3d size = Eigen::Vector3d::Zero();     ///< of the box, one corner at 0
    Eigen::Vector3i coarsest = Eigen::Vector3i::Ones(); ///< coarsest leaves on each axis
    double edge = 1.0;                                  ///< of a coarsest leaf
    int max_depth = 0;       ///< splits below the coarsest leaves; <= 20
    int voxels_per_leaf = 4; ///< along the edge of a finest leaf; >= 1

    int leaves_per_coarsest() const { return 1 << max_depth; } ///< finest ones, an axis
    int voxels_per_coarsest() const { return voxels_per_leaf << max_depth; }
    double voxel() const { return edge / voxels_per_coarsest(); }
};

/// The grid with \p across coarsest leaves along the longest side of \p size and
/// voxels no larger than \p max_voxel. The leaves are centred on the box; a side
/// that is a whole number of leaves, up to half a voxel, is cut into just so many.
GridShape grid_shape(const Eigen::Vector3d& size, int across, int max_depth,
                     double max_voxel);

/// Number of voxels of the grid, as a floating-point number: it may be huge.
double num_voxels(const GridShape& shape);

/// What is nearer to a voxel than this touches it, and what reaches no deeper into it
/// does no more than touch it [voxel]. Coordinates that were rounded to floats are off by
/// less.
inline constexpr double kTouch = 1e-3;

/// A block of voxels: first and last one on each axis.
struct VoxelRange
{
    Eigen::Vector3i first = Eigen::Vector3i::Zero(), last = Eigen::Vector3i::Zero();

    bool contains(const Eigen::Vector3i& v) const
    {
        return (v.array() >= first.array()).all() && (v.array() <= last.array()).all();
    }
    /// The voxels of \p other that are also in this block.
    VoxelRange cut(const VoxelRange& other) const
    {
        return {first.cwiseMax(other.first), last.cwiseMin(other.last)};
    }
};

/// Calls visit(voxel) for all of a block.
template <class Visit>
void for_each_voxel(const VoxelRange& range, Visit&& visit)
{
    for (int k = range.first.z(); k <= range.last.z(); ++k)
        for (int j = range.first.y(); j <= range.last.y(); ++j)
            for (int i = range.first.x(); i <= range.last.x(); ++i)
                visit(Eigen::Vector3i(i, j, k));
}

/// Calls visit(voxel) for the six that have a side in common with a voxel, those beyond a
/// grid among them.
template <class Visit>
void for_each_beside(const Eigen::Vector3i& voxel, Visit&& visit)
{
    for (int axis = 0; axis < 3; ++axis)
        for (const int step : {-1, 1})
        {
            Eigen::Vector3i next = voxel;
            next[axis] += step;
            visit(std::as_const(next));
        }
}

/// Which voxels hold material.
class VoxelGrid
{
public:
    explicit VoxelGrid(const GridShape& shape);

    const GridShape& shape() const { return shape_; }
    const Eigen::Vector3i& counts() const { return counts_; }
    std::size_t size() const { return material_.size(); }

    std::size_t index(int i, int j, int k) const
    {
        return (idx(k) * idx(counts_.y()) + idx(j)) * idx(counts_.x()) + idx(i);
    }
    std::size_t index(const Eigen::Vector3i& v) const
    {
        return index(v.x(), v.y(), v.z());
    }
    Eigen::Vector3i coordinates(std::size_t index) const;
    /// The number of the finest box of the octree that holds a voxel; those along x
    /// follow each other.
    std::size_t box(const Eigen::Vector3i& v) const
    {
        return box_of_line_[0][idx(v.x())] + box_of_line_[1][idx(v.y())] +
               box_of_line_[2][idx(v.z())];
    }
    std::size_t num_boxes() const { return num_boxes_; }
    VoxelRange voxels_of_box(std::size_t box) const;
    bool contains(const Eigen::Vector3i& v) const
    {
        return (v.array() >= 0).all() && (v.array() < counts_.array()).all();
    }

    /// The voxel of a point: half-open boxes; beyond the border the nearest one.
    Eigen::Vector3i locate(const Eigen::Vector3d& x) const;
    /// The voxels that a point touches, to within kTouch: up to eight, the one of
    /// locate() among them. Those on one axis are first[axis] to last[axis].
    VoxelRange touched(const Eigen::Vector3d& x) const;
    /// The voxels inside the box. The others of the grid have no extent.
    const VoxelRange& inside_box() const { return inside_box_; }
    /// The first corner of the grid's lattice: outside the box where that is no whole
    /// number of leaves.
    const Eigen::Vector3d& corner() const { return corner_; }
    /// A point in units of voxels, from the corner.
    Eigen::Vector3d to_voxels(const Eigen::Vector3d& x) const;
    Eigen::Vector3d from_voxels(const Eigen::Vector3d& x) const
    {
        return corner_ + shape_.voxel() * x;
    }
    /// Where the voxels of one axis begin and end: counts + 1 positions.
    const std::vector<double>& lines(int axis) const { return lines_[idx(axis)]; }
    /// Of the voxels at place \p i of an axis.
    double extent(int axis, int i) const
    {
        const std::vector<double>& at = lines_[idx(axis)];
        return at[idx(i) + 1] - at[idx(i)];
    }
    Eigen::Vector3d centre(const Eigen::Vector3i& v) const;

    /// Of every voxel 0, or the number of its material: where two that touch differ in
    /// it, nothing holds them together. 1 where nothing is apart.
    VoxelFlags& material() { return material_; }
    const VoxelFlags& material() const { return material_; }

private:
    GridShape shape_;
    Eigen::Vector3i counts_;
    Eigen::Vector3d corner_;
    VoxelRange inside_box_;
    std::array<std::vector<double>, 3> lines_;
    std::array<std::vector<std::size_t>, 3> box_of_line_; ///< what each adds
    std::size_t num_boxes_ = 1;
    VoxelFlags material_;
};

} // namespace cellwarp::core
