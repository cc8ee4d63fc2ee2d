// SPDX-License-Identifier: GPL-3.0-or-later
// The centre line of a limb, or of a whole shape.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "octree/material.h"

namespace cellwarp::core
{

/// A line in the middle of a shape, smoothed, from where a limb begins to its tip.
struct CentreLine
{
    std::vector<Eigen::Vector3d> places;
    double radius = 0.0; ///< of the shape around it: the least of any place but the tip
};

/// Of the limb at \p near (sample indices), from the first branching outside of them to
/// the tip; without any of the longest way through the shape. Uses the surface of
/// \p shape where it is closed, else a wrap around its samples. No places where there is
/// no such line, and in a build without CGAL.
CentreLine centre_line(const Shape& shape, const std::vector<std::uint32_t>& near);

} // namespace cellwarp::core
