// SPDX-License-Identifier: GPL-3.0-or-later
// The inside of a shape that no closed surface bounds: what its samples enclose once
// their openings are closed. open_inside.cpp tells how.
#pragma once

#include "octree/material.h"
#include "octree/voxel_grid.h"
#include "octree/voxel_values.h"

namespace cellwarp::core
{

struct OpenInside
{
    InsideMethod method = InsideMethod::None;
    VoxelFlags is_inside;       ///< of each voxel
    double flood_radius = -1.0; ///< at which the flood was kept out [voxel]; -1: at none
    double seal_radius = 0.0;   ///< of the widest opening that was closed [voxel]
};

/// \p marks: of the surface. \p votes: inside_votes() of a nearly closed surface, else
/// empty.
OpenInside open_inside(const VoxelGrid& grid, const VoxelFlags& marks,
                       const VoxelFlags& votes);

/// The widest opening that a flood is kept out of, as a radius [voxel].
int max_seal_radius(const GridShape& shape);

/// Openings are closed in larger voxels where those of \p shape are finer than that
/// needs: so many times as large, else 1.
int inside_scale(const GridShape& shape);
/// The grid of those over a grid of \p shape.
GridShape inside_grid(const GridShape& shape);

} // namespace cellwarp::core
