// SPDX-License-Identifier: GPL-3.0-or-later
// A pot with a spout and a handle, closed, and ways to open it.
#pragma once

#include <functional>

#include <Eigen/Core>

#include "octree/material.h"

namespace cellwarp::core::support
{

/// The closed, outward surface where \p distance is 0, negative inside, in cubes of edge
/// \p h from \p low to \p high; it must not reach the border.
Shape level_set(const std::function<double(const Eigen::Vector3d&)>& distance,
                const Eigen::Vector3d& low, const Eigen::Vector3d& high, double h);

/// A body 2 wide and 1.6 high around the origin, the axis along y, with a spout towards
/// x and a handle opposite, one closed surface around all of it; \p h is its resolution.
Shape pot(double h = 0.05);

/// The shape without the triangles whose centroids lie within \p radius of \p centre;
/// so are samples that no triangle uses.
Shape with_hole(const Shape& shape, const Eigen::Vector3d& centre, double radius);

/// The shape without the samples within \p radius of \p centre; no triangles.
Shape cloud_with_hole(const std::vector<Eigen::Vector3d>& points,
                      const Eigen::Vector3d& centre, double radius);

/// Moves the samples of all \p shapes so that their common box begins at 0; its size.
Eigen::Vector3d to_origin(std::initializer_list<Shape*> shapes);

} // namespace cellwarp::core::support
