// SPDX-License-Identifier: GPL-3.0-or-later
// The inside of closed and nearly closed surfaces, from the crossings of lines.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "octree/shape.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// How often a surface winds around a place: the solid angles of \p triangles there, as
/// shares of the whole one [VanOosterom83]. In proportion to the triangles; on the
/// surface any number between those of its sides.
double winding_number(const Shape& shape, const std::vector<Triangle>& triangles,
                      const Eigen::Vector3d& x);

/// Of each voxel whether a closed surface winds around its middle.
/// \param triangles of a BoundingSurface without open edges
VoxelFlags inside_by_winding(const Shape& shape, const std::vector<Triangle>& triangles,
                             const VoxelGrid& grid);

/// How many of the six axis rays of each voxel say that it is inside.
VoxelFlags inside_votes(const Shape& shape, const std::vector<Triangle>& triangles,
                        const VoxelGrid& grid);

/// Of the upper sides of \p voxels along an axis whether a closed surface winds around
/// their middles.
std::vector<char> sides_inside(const Shape& shape, const std::vector<Triangle>& triangles,
                               const VoxelGrid& grid, int axis,
                               const std::vector<std::size_t>& voxels);

} // namespace cellwarp::core
