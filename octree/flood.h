// SPDX-License-Identifier: GPL-3.0-or-later
// The inside of soups and clouds: what a flood from outside does not reach once
// their openings are closed; and the joining of what should be one piece.
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

/// Adds to the material a ball of radius \p r [voxel] around each of \p marks: a sheet of
/// points becomes connected. (A closing would take off again all that lies between.)
void spread(VoxelGrid& grid, const VoxelFlags& marks, double r);

/// Joins parts of the material that are at most \p reach voxels apart, nearest ones
/// first, by the voxels in between. Samples of one surface may otherwise touch at
/// an edge only, and would not be glued.
void join_fragments(VoxelGrid& grid, int reach);

} // namespace cellwarp
