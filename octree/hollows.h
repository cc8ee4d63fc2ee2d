// SPDX-License-Identifier: GPL-3.0-or-later
// The inside behind wide openings: hollows that are wider than the way into them. A jug
// without its lid has one, a bowl has none.
#pragma once

#include <functional>

#include "octree/voxel_grid.h"
#include "octree/voxel_values.h"

namespace cellwarp::core
{

/// Which openings are closed, as radii [voxel].
struct Openings
{
    double narrowest = 1.0; ///< > 0
    double widest = 1.0;    ///< >= narrowest
};

/// What lies behind wide openings.
struct Hollows
{
    double radius = -1.0; ///< of the widest opening that was closed [voxel]; -1: none
    VoxelFlags is_inside; ///< of each voxel
};

/// The hollows of the surface that \p marks (not 0) show, each up to the smallest radius
/// that closes it: between those of the openings, in steps of a quarter, none wider than
/// BallFlood::kLargest tells. A hollow has
/// room for a ball a quarter larger than that. Nothing on the outside, no mark, and only
/// what \p may_fill accepts.
Hollows hollow_voxels(const VoxelGrid& grid, const VoxelFlags& marks,
                      const Openings& openings,
                      const std::function<bool(std::size_t)>& may_fill);

} // namespace cellwarp::core
