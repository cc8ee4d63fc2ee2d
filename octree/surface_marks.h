// SPDX-License-Identifier: GPL-3.0-or-later
// Which voxels the surface of a shape touches, and how.
#pragma once

#include <cstdint>
#include <vector>

#include "octree/shape.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// How the surface touches one voxel. A face of the shape that lies in the plane between
/// two layers of voxels touches those on both sides alike: which of them is material
/// depends on where the inside is (settle_material()).
struct SurfaceMark
{
    static constexpr std::uint8_t kPenetrated = 1; ///< it reaches into the voxel
    static constexpr std::uint8_t kTouched = 2;
    /// Part of it lies in one side of the voxel.
    static constexpr std::uint8_t side(int axis, bool is_upper)
    {
        return static_cast<std::uint8_t>(4 << (2 * axis + is_upper));
    }
    static constexpr std::uint8_t kSides = 0xfc;
};

/// For every voxel the SurfaceMark bits of the triangles and of the samples that are in
/// none. A sample reaches into every voxel that it touches.
VoxelFlags surface_marks(const Shape& shape, const VoxelGrid& grid);

/// What is inside and not touched by the surface.
VoxelFlags beyond_marks(VoxelFlags is_inside, const VoxelFlags& marks);

} // namespace cellwarp::core
