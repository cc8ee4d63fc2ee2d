// SPDX-License-Identifier: GPL-3.0-or-later
// Turns and shifts of a joint at times, and between them. joint_keys.cpp has the
// formulas.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cellwarp::core
{

/// How values come about between two keys.
enum class Interpolation
{
    Step,   ///< the earlier one
    Linear, ///< evenly; of turns on the sphere (slerp)
    Smooth, ///< with one speed at each key, by the keys around it; of turns squad
    Cubic   ///< by tangents that are given
};

/// Before its first key and after its last one a value holds. One that has no key is at
/// rest.
struct TurnKeys
{
    Interpolation kind = Interpolation::Linear;
    std::vector<double> times;             ///< [s], strictly increasing
    std::vector<Eigen::Quaterniond> turns; ///< unit
    /// Of Interpolation::Cubic: d/dt of the quaternion before and after each key [1/s].
    std::vector<std::array<Eigen::Vector4d, 2>> tangents = {}; ///< x y z w

    Eigen::Quaterniond at(double time) const;
};

struct ShiftKeys
{
    Interpolation kind = Interpolation::Linear;
    std::vector<double> times; ///< [s], strictly increasing
    std::vector<Eigen::Vector3d> shifts;
    std::vector<std::array<Eigen::Vector3d, 2>> tangents = {}; ///< [1/s]

    Eigen::Vector3d at(double time) const;
};

/// All keys of a joint.
struct JointKeys
{
    TurnKeys turns;
    ShiftKeys shifts;
};

/// The rotation vector of a unit quaternion, of at most half a turn [rad]. Half a turn,
/// to kHalfTurnRounding, goes round as the quaternion's sign says.
Eigen::Vector3d logarithm(const Eigen::Quaterniond& turn);
/// The turn at \p u in [0, 1] between two, evenly and by the shortest way. Half a turn,
/// to kHalfTurnRounding, goes round as the signs of the quaternions say: made from an
/// axis and an angle within a whole turn either way, they go as the angle does.
Eigen::Quaterniond part_of_turn(const Eigen::Quaterniond& from,
                                const Eigen::Quaterniond& to, double u);
/// The one of the two signs of \p turn to which the shortest way from \p before leads; of
/// half a turn \p turn as it is.
Eigen::Quaterniond nearer_sign(const Eigen::Quaterniond& before,
                               const Eigen::Quaterniond& turn);
/// The quaternion of a rotation vector [rad].
Eigen::Quaterniond exponential(const Eigen::Vector3d& vector);

} // namespace cellwarp::core
