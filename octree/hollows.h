// SPDX-License-Identifier: GPL-3.0-or-later
// The inside behind wide openings: hollows that are wider than the way into them. A jug
// without its lid has one, a bowl has none.
#pragma once

#include <functional>

#include "octree/voxel_grid.h"

namespace cellwarp
{

/// Which openings fill_hollows() closes, as radii [voxel].
struct Openings
{
    double narrowest = 1.0; ///< > 0
    double widest = 1.0;    ///< >= narrowest
};

/// Fills the hollows of the surface that \p grid marks, each up to the narrowest wrap
/// that closes it: between the openings' radii, in steps of a quarter. A hollow has room
/// for a ball a quarter larger than that wrap's. Nothing is added on the outside. Only
/// voxels that \p may_fill accepts are filled. Returns the radius of the widest opening
/// that was closed [voxel], or -1 if there is no hollow, or no wrap in this build.
double fill_hollows(VoxelGrid& grid, const Openings& openings,
                    const std::function<bool(std::size_t)>& may_fill);

} // namespace cellwarp
