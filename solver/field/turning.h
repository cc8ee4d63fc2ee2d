// SPDX-License-Identifier: GPL-3.0-or-later
// What has a direction turns with the map of space around it. Where the map is the
// identity, everything keeps its bits.
#pragma once

#include <Eigen/Core>

namespace cellwarp::core
{

/// A normal after the map with Jacobian J: the cofactor matrix keeps it normal to
/// the surface, also where J is singular in one direction. The length is kept.
Eigen::Vector3d turned_normal(const Eigen::Matrix3d& J, const Eigen::Vector3d& normal);

/// A tangent after the map with Jacobian J: it stays tangent to the surface. The length
/// is kept; where J leaves nothing of it, the tangent stays.
Eigen::Vector3d turned_tangent(const Eigen::Matrix3d& J, const Eigen::Vector3d& tangent);

/// A rotation, as a quaternion w x y z, after the map with Jacobian J: the rotation that
/// is closest to J comes after it. The length is kept, and of the two signs the one
/// nearer to the old quaternion. Where J is singular or mirrors, the closest rotation
/// that does not is taken: the last of J's principal directions is turned over.
Eigen::Vector4d turned_rotation(const Eigen::Matrix3d& J,
                                const Eigen::Vector4d& rotation);

} // namespace cellwarp::core
