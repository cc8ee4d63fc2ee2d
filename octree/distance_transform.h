// SPDX-License-Identifier: GPL-3.0-or-later
// Exact Euclidean distances on a grid, however far: for telling what is nearest.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "octree/voxel_values.h"

namespace cellwarp::core
{

/// Squared distance of every voxel to the nearest one that is not 0 in \p marks,
/// in voxels; infinity if there is none. Separable lower envelopes of parabolas,
/// linear in the number of voxels. x runs fastest.
std::vector<float> squared_distances(const VoxelFlags& marks,
                                     const Eigen::Vector3i& counts);

/// Gives every voxel whose label is negative the label of the voxel nearest to it that
/// has one; of equally near ones always the same. Nothing where none has.
void spread_labels(std::vector<std::int32_t>& labels, const Eigen::Vector3i& counts);

} // namespace cellwarp::core
