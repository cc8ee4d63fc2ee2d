// SPDX-License-Identifier: GPL-3.0-or-later
// Lines of rods and curves as they are stated, for posing and in time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// A line at rest, and how thick it is, in the unit of its owner.
struct SplineLine
{
    enum class Form
    {
        Through, ///< points on it
        Points,  ///< control points
        Skeleton ///< the centre line of the shape, which has no points yet
    };
    Form form = Form::Through;
    std::vector<Eigen::Vector3d> points = {};
    bool is_closed = false;
    std::int64_t spans = 4; ///< in each gap between two points that it goes through
    std::int64_t degree = 3;
    std::string knots = "nonuniform"; ///< of control points
    std::vector<double> radii;        ///< evenly along it, linear in between; > 0

    bool operator==(const SplineLine&) const = default;
};

} // namespace cellwarp::core
