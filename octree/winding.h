// SPDX-License-Identifier: GPL-3.0-or-later
// The inside of closed and nearly closed surfaces, from the crossings of lines.
#pragma once

#include <cstdint>
#include <vector>

#include "octree/material.h"
#include "octree/voxel_grid.h"

namespace cellwarp
{

/// The triangles that bound something: coincident corners joined, degenerate ones
/// and repeated copies dropped.
std::vector<Triangle> bounding_triangles(const Shape& shape);

/// The share of edges that lack their opposite; 0: closed and oriented, 1: no
/// triangle. \p triangles from bounding_triangles().
double open_edge_share(const std::vector<Triangle>& triangles);

/// Of each voxel whether a closed surface winds around its middle.
VoxelFlags inside_by_winding(const Shape& shape, const std::vector<Triangle>& triangles,
                             const VoxelGrid& grid);

/// How many of the six axis rays of each voxel say that it is inside.
VoxelFlags inside_votes(const Shape& shape, const std::vector<Triangle>& triangles,
                        const VoxelGrid& grid);

} // namespace cellwarp
