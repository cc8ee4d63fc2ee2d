// SPDX-License-Identifier: GPL-3.0-or-later
// Where a surface passes through itself.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "octree/shape.h"

namespace cellwarp
{

/// Pairs of triangles.
struct SelfIntersections
{
    std::int64_t all = 0;   ///< that intersect
    std::int64_t fresh = 0; ///< of them those that do not at rest
};

/// Those of a surface whose samples are at \p places now and were at \p rest; samples
/// that coincide at rest are one corner. Neighbours count where they have more in common
/// than their corner or edge. Nothing in a build without CGAL, or where the triangles are
/// so crammed that the boxes of 1,000 others would have to be looked at for each.
std::optional<SelfIntersections>
self_intersections(std::span<const Triangle> triangles,
                   const std::vector<Eigen::Vector3d>& places,
                   const std::vector<Eigen::Vector3d>& rest);

} // namespace cellwarp
