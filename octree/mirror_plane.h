// SPDX-License-Identifier: GPL-3.0-or-later
// Planes that a shape is its own mirror image in.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

struct MirrorPlane
{
    Eigen::Vector3d normal; ///< unit
    double at = 0.0;        ///< normal . x of its points

    /// Signed distance from the plane.
    double side(const Eigen::Vector3d& x) const { return normal.dot(x) - at; }
    Eigen::Vector3d mirrored(const Eigen::Vector3d& x) const
    {
        return x - 2.0 * side(x) * normal;
    }
    Eigen::Vector3d projected(const Eigen::Vector3d& x) const
    {
        return x - side(x) * normal;
    }
};

/// Planes in which nearly all samples have a sample near their mirror image, the best
/// first; each differs from those before it. A shape that turns into itself has many:
/// those of them that are found are in the list. Depends on the samples alone.
std::vector<MirrorPlane> mirror_planes(const std::vector<Eigen::Vector3d>& samples);

} // namespace cellwarp::core
