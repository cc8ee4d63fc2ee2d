// SPDX-License-Identifier: GPL-3.0-or-later
// Which voxels of material lie in the shapes of a region.
#pragma once

#include <cstdint>
#include <vector>

#include "library/session/body.h"
#include "library/session/regions.h"
#include "octree/voxel_runs.h"

namespace cellwarp::core
{

/// The voxels whose centres lie in the shapes of a region; of a rod also those that its
/// line passes.
VoxelRuns voxels_in_shapes(const Region& region, const RestShape& rest);

/// The material that the lines of a bone pass or touch, each once, ascending: on the
/// border of two cells it is in both.
std::vector<std::uint32_t> voxels_on_bone(const Region& region, const VoxelGrid& grid);

} // namespace cellwarp::core
