// SPDX-License-Identifier: GPL-3.0-or-later
// Rigid motions: of space, of a cell, and small ones.
#pragma once

#include <Eigen/Core>

namespace cellwarp::core
{

/// A rigid motion of space, x -> R x + t.
struct Motion
{
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Eigen::Vector3d t = Eigen::Vector3d::Zero();

    Eigen::Vector3d operator()(const Eigen::Vector3d& x) const { return R * x + t; }
};

/// First \p second, then \p first.
Motion operator*(const Motion& first, const Motion& second);
Motion inverse(const Motion& motion);

/// Where a cell with rest centre c is: T(x) = R (x - c) + p. The state of the solver.
struct Pose
{
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
};

/// The image of the rest point \p x of a cell with rest centre \p centre.
inline Eigen::Vector3d image(const Pose& pose, const Eigen::Vector3d& centre,
                             const Eigen::Vector3d& x)
{
    return pose.R * (x - centre) + pose.p;
}

/// The displacement T(x) - x; exactly 0 for a pose at rest.
Eigen::Vector3d displacement(const Pose& pose, const Eigen::Vector3d& centre,
                             const Eigen::Vector3d& x);

/// The pose of a cell that \p motion carries along from rest.
Pose carried(const Motion& motion, const Eigen::Vector3d& centre);

/// A small motion of a cell about its current centre: (angular [rad], linear).
using Twist = Eigen::Matrix<double, 6, 1>;

/// The matrix of the cross product: cross_matrix(a) b = a x b.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a);

/// The rotation closest to the affine map I + [omega]x: axis omega, angle
/// atan |omega|. [Botsch07]
Eigen::Matrix3d closest_rotation(const Eigen::Vector3d& omega);

/// The rotation by \p angle [rad] about a unit axis.
Eigen::Matrix3d rotation_about(const Eigen::Vector3d& axis, double angle);

/// The pose after a twist, projected to a rigid motion. Poses whose twists are those of
/// one rigid body keep their places to each other.
Pose moved(const Pose& pose, const Twist& twist);

/// The same by shape matching alone: turned by the closest rotation, shifted by the
/// linear part. [Botsch07]
Pose shape_matched(const Pose& pose, const Twist& twist);

/// Axis times angle of a rotation [rad]; the angle is in [0, pi]. A half turn (see
/// is_half_turn()) has the axis whose first component above 0.3 in size is positive, and
/// an angle of up to pi + kHalfTurnRounding.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R);

} // namespace cellwarp::core
