// SPDX-License-Identifier: GPL-3.0-or-later
// Which sample each voxel of material is nearest to, measured through the material.
#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "octree/notches.h"
#include "octree/voxel_grid.h"

namespace cellwarp
{

inline constexpr std::uint32_t kNoSample = 0xffffffffu; // VoxelNumbers' none

/// For every voxel the sample nearest to its centre, handed on from voxel to voxel
/// through faces of the material (so never across a gap), in order of distance.
/// kNoSample where there is no material or no sample in reach. Linear in the
/// number of voxels of material. \p voxel_of_sample: Parts::voxel_of_sample. Nor is
/// anything handed on through open sides of \p notches.
VoxelNumbers<std::uint32_t>
nearest_samples(const VoxelGrid& grid, std::span<const Eigen::Vector3d> samples,
                std::span<const std::size_t> voxel_of_sample = {},
                const Notches& notches = {});

} // namespace cellwarp
