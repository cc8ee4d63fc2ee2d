// SPDX-License-Identifier: GPL-3.0-or-later
// Whether two triangles intersect. Optional: a build without CGAL has
// no_triangle_pair.cpp in its place, which cannot tell.
#pragma once

#include <array>

#include <Eigen/Core>

namespace cellwarp::core
{

/// Whether triangles_meet() can tell.
bool can_tell_triangle_pairs();

/// Whether two triangles have more in common than the \p shared first corners of both,
/// which are the same, in the same order. Exact for all finite numbers. A triangle
/// without area meets nothing.
bool triangles_meet(const std::array<Eigen::Vector3d, 3>& a,
                    const std::array<Eigen::Vector3d, 3>& b, int shared);

} // namespace cellwarp::core
