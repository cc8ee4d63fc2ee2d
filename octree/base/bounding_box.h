// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include <Eigen/Geometry>

namespace cellwarp::core
{

/// The smallest box along the axes that holds the points; empty without points.
inline Eigen::AlignedBox3d box_around(std::span<const Eigen::Vector3d> points)
{
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& x : points)
        box.extend(x);
    return box;
}

} // namespace cellwarp::core
