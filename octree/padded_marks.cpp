// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/padded_marks.h"

namespace cellwarp::core
{

PaddedMarks::PaddedMarks(const VoxelGrid& grid, const VoxelFlags& marks, int border,
                         int multiple)
    : border_(border), of_grid_(grid.counts()),
      counts_((of_grid_.array() + 2 * border + multiple - 1) / multiple * multiple),
      marks_(idx(counts_.x()) * idx(counts_.y()) * idx(counts_.z()))
{
    for (int k = 0; k < of_grid_.z(); ++k)
        for (int j = 0; j < of_grid_.y(); ++j)
        {
            const std::size_t row = grid.index(0, j, k), to = at({0, j, k});
            for_each_set(marks, row, row + idx(of_grid_.x()),
                         [&](std::size_t voxel)
                         { marks_[to + (voxel - row)] = marks[voxel]; });
        }
}

} // namespace cellwarp::core
