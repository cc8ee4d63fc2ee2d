// SPDX-License-Identifier: GPL-3.0-or-later
// The closest rotation to A = I + [w]x in the Frobenius norm is the rotational part
// of its polar decomposition. A acts as 1 along w and as the plane similarity
// (1, |w|) across it, which is sqrt(1 + |w|^2) times a rotation by atan |w|.
//
// Cells that make one rigid motion have one w and v_i - v_j = w x (p_i - p_j). They stay
// rigid to each other, however large the step, if p_i' = p_i + A v_i with A [w]x = R - I:
//   A = I + k ([w]x + [w]x^2),  k = 1 / (s (s + 1)),  s = sqrt(1 + |w|^2),
// to second order v + 1/2 w x v. With p_i' = p_i + v_i a stiff part would be strained by
// its own turning, and could only turn in tiny steps.
#include "octree/base/rigid_motion.h"

#include <cmath>

#include <Eigen/Geometry>

#include "octree/base/half_turn.h"

namespace cellwarp::core
{

namespace
{

/// One step towards the nearest orthogonal matrix; the error is squared, and the
/// identity stays the identity. Keeps products of many rotations orthonormal.
Eigen::Matrix3d reorthonormalised(const Eigen::Matrix3d& R)
{
    return R * (1.5 * Eigen::Matrix3d::Identity() - 0.5 * (R.transpose() * R));
}

} // namespace

Motion operator*(const Motion& first, const Motion& second)
{
    return {reorthonormalised(first.R * second.R), first.R * second.t + first.t};
}

Motion inverse(const Motion& motion)
{
    return {motion.R.transpose(), -(motion.R.transpose() * motion.t)};
}

Eigen::Vector3d displacement(const Pose& pose, const Eigen::Vector3d& centre,
                             const Eigen::Vector3d& x)
{
    return (pose.R - Eigen::Matrix3d::Identity()) * (x - centre) + (pose.p - centre);
}

Pose carried(const Motion& motion, const Eigen::Vector3d& centre)
{
    // As a displacement, so that a motion that does nothing does exactly nothing.
    const Eigen::Vector3d d =
        (motion.R - Eigen::Matrix3d::Identity()) * centre + motion.t;
    return {motion.R, centre + d};
}

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a)
{
    Eigen::Matrix3d A;
    A << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return A;
}

Eigen::Matrix3d closest_rotation(const Eigen::Vector3d& omega)
{
    // Rodrigues' formula with sin = |w| / s and cos = 1 / s, s = sqrt(1 + |w|^2);
    // (1 - cos) / |w|^2 = 1 / (s (s + 1)) has no singularity at 0.
    const double s = std::sqrt(1.0 + omega.squaredNorm());
    const Eigen::Matrix3d W = cross_matrix(omega);
    return Eigen::Matrix3d::Identity() + W / s + W * W / (s * (s + 1.0));
}

Eigen::Matrix3d rotation_about(const Eigen::Vector3d& axis, double angle)
{
    if (angle == 0.0)
        return Eigen::Matrix3d::Identity();
    return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

Pose moved(const Pose& pose, const Twist& twist)
{
    const Eigen::Vector3d omega = twist.head<3>(), v = twist.tail<3>();
    const double s = std::sqrt(1.0 + omega.squaredNorm());
    const Eigen::Vector3d turn = omega.cross(v);
    return {reorthonormalised(closest_rotation(omega) * pose.R),
            pose.p + v + (turn + omega.cross(turn)) / (s * (s + 1.0))};
}

Pose shape_matched(const Pose& pose, const Twist& twist)
{
    return {reorthonormalised(closest_rotation(twist.head<3>()) * pose.R),
            pose.p + twist.tail<3>()};
}

namespace
{

/// The least w = cos(angle / 2) of a rotation that is no half turn.
constexpr double kHalfTurnCosine = 0.5 * kHalfTurnRounding;

/// Whether the first component of an axis that is not small is negative. Some component
/// of a unit vector is above 0.57.
bool points_back(const Eigen::Vector3d& axis)
{
    constexpr double kNotSmall = 0.3;
    int k = 0;
    while (k < 2 && std::abs(axis[k]) <= kNotSmall)
        ++k;
    return axis[k] < 0.0;
}

} // namespace

bool is_half_turn(const Eigen::Matrix3d& R)
{
    return std::abs(Eigen::Quaterniond(R).w()) <= kHalfTurnCosine;
}

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R)
{
    const Eigen::Quaterniond q(R);
    const double sine = q.vec().norm();
    if (sine == 0.0)
        return Eigen::Vector3d::Zero();
    // q and -q are one rotation: the one with w >= 0 turns by at most pi.
    const bool is_other =
        std::abs(q.w()) <= kHalfTurnCosine ? points_back(q.vec() / sine) : q.w() < 0.0;
    const double sign = is_other ? -1.0 : 1.0;
    return sign * 2.0 * std::atan2(sine, sign * q.w()) / sine * q.vec();
}

} // namespace cellwarp::core
