// SPDX-License-Identifier: GPL-3.0-or-later
// A turn k = (w, v) is split at an axis a: the part of v along a alone makes the twist
// (w, (v.a) a), normalised; what is left, k twist^-1, turns about an axis across a. Where
// both w and v.a are zero the swing is half a turn, and any twist would do: none is
// taken.
#include "solver/skeleton/joint_limits.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cellwarp::core
{

namespace
{

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kTurn = 2.0 * std::numbers::pi;

/// An angle in (-pi, pi].
double wrapped(double angle)
{
    return angle - kTurn * std::ceil((angle - std::numbers::pi) / kTurn);
}

/// The angle within limits that is nearest on the circle; an angle stands for all that
/// are whole turns away.
double nearest_within(double angle, const std::array<double, 2>& limits)
{
    const auto& [least, most] = limits;
    if (std::isinf(least) || std::isinf(most))
        return angle;
    if (angle + kTurn * std::ceil((least - angle) / kTurn) <= most)
        return angle;
    return std::abs(wrapped(angle - least)) <= std::abs(wrapped(angle - most)) ? least
                                                                               : most;
}

Quaterniond about(const Vector3d& axis, double angle)
{
    return Quaterniond(Eigen::AngleAxisd(angle, axis));
}

} // namespace

bool JointLimits::are_none() const
{
    return !hinge && std::isinf(twist[0]) && std::isinf(twist[1]) && std::isinf(swing);
}

double twist_angle(const Quaterniond& turn, const Vector3d& axis)
{
    const double along = turn.vec().dot(axis);
    if (along == 0.0 && turn.w() == 0.0)
        return 0.0;
    return wrapped(2.0 * std::atan2(along, turn.w()));
}

Quaterniond limited(const Quaterniond& turn, const JointLimits& limits,
                    const Vector3d& bone)
{
    // Angles beyond a limit by less are rounding [rad].
    constexpr double kSame = 1e-14;
    if (limits.are_none())
        return turn;
    const Vector3d axis = limits.hinge.value_or(bone);
    const double angle = twist_angle(turn, axis);
    const double twist = nearest_within(angle, limits.twist);
    const Quaterniond swing = turn * about(axis, -angle);
    const double swung = 2.0 * std::atan2(swing.vec().norm(), std::abs(swing.w()));
    const double most = limits.hinge ? 0.0 : limits.swing;
    if (std::abs(twist - angle) <= kSame && swung <= most + kSame)
        return turn;
    if (swung <= most + kSame)
        return swing * about(axis, twist);
    const Vector3d across =
        std::copysign(1.0, swing.w()) * swing.vec().stableNormalized();
    return about(across, most) * about(axis, twist);
}

} // namespace cellwarp::core
