// SPDX-License-Identifier: GPL-3.0-or-later
// Rotations by half a turn: both ways round are equal, so rounding must not choose one.
#pragma once

#include <Eigen/Core>

namespace cellwarp::core
{

/// The distance from pi at which an angle still counts as a half turn [rad]: numbers that
/// were stored in single precision, or computed in double, are off by less.
inline constexpr double kHalfTurnRounding = 1e-6;

/// Whether a rotation turns by pi, to kHalfTurnRounding. rotation_vector() turns about
/// the axis then whose first component above 0.3 in size is positive, by up to
/// pi + kHalfTurnRounding.
bool is_half_turn(const Eigen::Matrix3d& R);

} // namespace cellwarp::core
