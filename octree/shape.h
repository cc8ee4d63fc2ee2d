// SPDX-License-Identifier: GPL-3.0-or-later
// What a shape is given as.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

using Triangle = std::array<std::uint32_t, 3>;
using LineEnds = std::array<std::uint32_t, 2>; ///< its two ends

/// A shape as samples; triangles and lines index them. Samples in neither count as
/// points.
struct Shape
{
    std::vector<Eigen::Vector3d> samples;
    std::vector<Triangle> triangles;
    std::vector<LineEnds> lines = {};

    bool is_cloud() const { return triangles.empty() && lines.empty(); }
};

} // namespace cellwarp::core
