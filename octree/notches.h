// SPDX-License-Identifier: GPL-3.0-or-later
// Notches: where the surface of a closed shape runs on both sides of narrow space, voxels
// of its material lie side by side with nothing but that space between them.
#pragma once

#include <cstddef>
#include <utility>

#include <Eigen/Core>

#include "octree/bounding_surface.h"
#include "octree/shape.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// Of every voxel whether there is nothing in its upper side along each axis, though it
/// and the next voxel are of one material.
class Notches
{
public:
    Notches() = default;
    /// \p open_sides: of each voxel bit k for its upper side along axis k.
    Notches(const VoxelGrid& grid, VoxelFlags open_sides);

    bool empty() const { return open_sides_.empty(); }
    bool is_open(std::size_t voxel, int axis) const
    {
        return !empty() && (open_sides_[voxel] >> axis & 1) != 0;
    }
    /// Whether any voxel of a finest box (see VoxelGrid::box()) has an open side.
    bool are_in(std::size_t box) const { return !empty() && is_in_box_[box] != 0; }
    const VoxelFlags& open_sides() const { return open_sides_; }

private:
    VoxelFlags open_sides_; ///< empty where there are none
    VoxelFlags is_in_box_;
};

/// The notches of a shape whose surface is closed, in the material of \p grid: a side
/// between two voxels is open where no triangle meets it and the surface does not wind
/// around its middle.
/// \param surface of \p shape; where it is not closed there are no notches.
Notches find_notches(const Shape& shape, const BoundingSurface& surface,
                     const VoxelGrid& grid);

} // namespace cellwarp::core
