// SPDX-License-Identifier: GPL-3.0-or-later
// What a shape is given as.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace cellwarp
{

using Triangle = std::array<std::uint32_t, 3>;

/// A shape as samples; triangles index them. Samples in no triangle count as
/// points.
struct Shape
{
    std::vector<Eigen::Vector3d> samples;
    std::vector<Triangle> triangles;
};

} // namespace cellwarp
