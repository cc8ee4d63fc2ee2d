// SPDX-License-Identifier: GPL-3.0-or-later
// Where a surface passes through itself.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "octree/shape.h"

namespace cellwarp::core
{

class SurfacePatches;

/// Pairs of triangles.
struct SelfIntersections
{
    std::int64_t all = 0;   ///< that intersect
    std::int64_t fresh = 0; ///< of them those that do not at rest
    /// The first triangle of those, by its number; nothing: there is none.
    std::optional<std::size_t> first_fresh = std::nullopt;
};

/// Counts those of a surface wherever its samples are. Samples that coincide at rest are
/// one corner. Neighbours count where they have more in common than their corner or edge.
class IntersectionCounter
{
public:
    /// Both must outlive this.
    IntersectionCounter(std::span<const Triangle> triangles,
                        const std::vector<Eigen::Vector3d>& rest);
    IntersectionCounter(std::span<const Triangle> triangles,
                        const std::vector<Eigen::Vector3d>&& rest) = delete;
    ~IntersectionCounter();

    /// With the samples at \p places, as many as at rest. Nothing in a build without
    /// CGAL, or where the triangles are so crammed that the boxes of 1,000 others would
    /// have to be looked at for each.
    std::optional<SelfIntersections>
    count(const std::vector<Eigen::Vector3d>& places) const;

private:
    class Count;

    std::span<const Triangle> triangles_;
    const std::vector<Eigen::Vector3d>& rest_;
    std::vector<std::uint32_t> joined_; ///< of each sample the first at its place
    std::vector<std::uint32_t> order_;  ///< of the triangles
    std::unique_ptr<const SurfacePatches> patches_;
};

} // namespace cellwarp::core
