// SPDX-License-Identifier: GPL-3.0-or-later
// A closed surface around points. Optional: a build without CGAL has no_wrap.cpp in
// its place.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/material.h"

namespace cellwarp::core
{

/// The closed, oriented surface around \p points that a ball of radius \p alpha rolls
/// on when it comes from outside: it stays \p offset away from all points, enters
/// nothing that is narrower than the ball, and so closes openings up to 2 alpha wide.
/// Depends on the points alone, not on threads. Empty where there is no point, and in
/// a build without CGAL.
/// \pre alpha > 0, offset > 0
Shape alpha_wrap(std::span<const Eigen::Vector3d> points, double alpha, double offset);
/// The same around the triangles of \p surface: the ball does not pass between their
/// corners, however small it is.
Shape alpha_wrap(const Shape& surface, double alpha, double offset);

} // namespace cellwarp::core
