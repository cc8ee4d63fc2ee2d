// SPDX-License-Identifier: GPL-3.0-or-later
// The skeleton of a closed surface: curves in its middle. Optional: a build without CGAL
// has no_skeleton.cpp in its place.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "octree/material.h"

namespace cellwarp::core
{

struct CurveSkeleton
{
    std::vector<Eigen::Vector3d> points;
    std::vector<std::array<int, 2>> edges;
    /// Of each point the places of the surface that came to it.
    std::vector<std::vector<Eigen::Vector3d>> around;
};

/// Whether curve_skeleton() finds anything in this build.
bool has_curve_skeleton();

/// Of the largest part of \p surface that is closed by itself, by mean curvature flow
/// [Tagliasacchi12]. Depends on the surface alone. Empty where no part is a closed
/// surface, and in a build without CGAL. Throws std::system_error where its program
/// cannot be started.
CurveSkeleton curve_skeleton(const Shape& surface);

} // namespace cellwarp::core
