// SPDX-License-Identifier: GPL-3.0-or-later
// The inside of soups and clouds: what a flood from outside does not reach once
// their openings are closed.
#pragma once

#include <cstdint>
#include <functional>

#include "octree/voxel_grid.h"
#include "octree/voxel_values.h"

namespace cellwarp
{

/// What a flood from outside does not reach.
struct EnclosedVoxels
{
    double radius = -1.0; ///< of the openings that were closed [voxel]; -1: none enclosed
    VoxelFlags is_inside; ///< of each voxel, marks among them
};

/// What \p marks (not 0) enclose once openings up to a radius are closed: the smallest
/// radius, at most \p max_radius [voxel], that seals. Nothing on the outside is enclosed,
/// and nothing but what \p may_fill accepts.
EnclosedVoxels enclosed_voxels(const VoxelGrid& grid, const VoxelFlags& marks,
                               int max_radius,
                               const std::function<bool(std::size_t)>& may_fill);

} // namespace cellwarp
