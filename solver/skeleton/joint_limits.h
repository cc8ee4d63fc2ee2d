// SPDX-License-Identifier: GPL-3.0-or-later
// How far a joint turns.
#pragma once

#include <array>
#include <limits>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cellwarp::core
{

/// Of a joint's turn from rest, which is a twist about its axis and then a swing of that
/// axis: k = swing twist.
struct JointLimits
{
    /// The joint turns about this axis alone [unit]; none: about the direction of its
    /// bone and across.
    std::optional<Eigen::Vector3d> hinge;
    /// Least and largest angle about the axis, least <= largest [rad].
    std::array<double, 2> twist = {-std::numeric_limits<double>::infinity(),
                                   std::numeric_limits<double>::infinity()};
    /// Largest angle by which the axis leaves its rest direction, >= 0 [rad].
    double swing = std::numeric_limits<double>::infinity();

    bool are_none() const;
};

/// Angle of the part of \p turn about the unit \p axis, in (-pi, pi] [rad].
double twist_angle(const Eigen::Quaterniond& turn, const Eigen::Vector3d& axis);

/// The turn within \p limits with the nearest twist and the nearest swing; the same to
/// the bit where it is within them. \p axis: unit, the bone's direction; that of a hinge
/// is its own.
Eigen::Quaterniond limited(const Eigen::Quaterniond& turn, const JointLimits& limits,
                           const Eigen::Vector3d& axis);

} // namespace cellwarp::core
