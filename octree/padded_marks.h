// SPDX-License-Identifier: GPL-3.0-or-later
// The marks of a grid with free voxels all around.
#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/voxel_grid.h"
#include "octree/voxel_values.h"

namespace cellwarp::core
{

class PaddedMarks
{
public:
    /// \p border voxels on every side at least, and on the far sides as many more as
    /// make each count a multiple of \p multiple.
    PaddedMarks(const VoxelGrid& grid, const VoxelFlags& marks, int border,
                int multiple = 1);

    const Eigen::Vector3i& counts() const { return counts_; }
    const VoxelFlags& marks() const { return marks_; }
    /// The place here of a voxel of the grid.
    std::size_t at(const Eigen::Vector3i& voxel) const
    {
        return (idx(voxel.z() + border_) * idx(counts_.y()) + idx(voxel.y() + border_)) *
                   idx(counts_.x()) +
               idx(voxel.x() + border_);
    }
    /// Calls visit(place here, voxel of the grid) for the voxels of the grid that are not
    /// 0 in \p set, which tells of all places, ascending.
    template <class Visit>
    void for_each_in_grid(const VoxelFlags& set, Visit&& visit) const
    {
        const std::size_t nx = idx(of_grid_.x());
        std::size_t row = 0; // the first voxel of a line
        for (int k = 0; k < of_grid_.z(); ++k)
            for (int j = 0; j < of_grid_.y(); ++j, row += nx)
            {
                const std::size_t from = at({0, j, k});
                for_each_set(set, from, from + nx,
                             [&](std::size_t place)
                             { visit(place, row + (place - from)); });
            }
    }

private:
    int border_;
    Eigen::Vector3i of_grid_, counts_;
    VoxelFlags marks_;
};

} // namespace cellwarp::core
