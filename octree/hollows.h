// SPDX-License-Identifier: GPL-3.0-or-later
// The inside behind wide openings: hollows that are wider than the way into them. A jug
// without its lid has one, a bowl has none.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "octree/flood.h"
#include "octree/voxel_grid.h"

namespace cellwarp
{

/// Which openings are closed, as radii [voxel].
struct Openings
{
    double narrowest = 1.0; ///< > 0
    double widest = 1.0;    ///< >= narrowest
};

/// The hollows of the surface that \p marks (not 0) show, each up to the narrowest wrap
/// that closes it: between the openings' radii, in steps of a quarter. A hollow has room
/// for a ball a quarter larger than that wrap's. Nothing on the outside, no mark, and
/// only what \p may_fill accepts. The radius is that of the widest opening that was
/// closed, or -1 if there is no hollow, or no wrap in this build.
EnclosedVoxels hollow_voxels(const VoxelGrid& grid, const VoxelFlags& marks,
                             const Openings& openings,
                             const std::function<bool(std::size_t)>& may_fill);

} // namespace cellwarp
