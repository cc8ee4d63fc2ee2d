// SPDX-License-Identifier: GPL-3.0-or-later
// Rigid motions as they are stated, in files and by hand. A Motion is what is done.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// A turn about a pivot, then a shift, in the unit of its owner.
struct RigidMove
{
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();
    Eigen::Vector3d axis = Eigen::Vector3d::UnitX(); ///< has a length
    double degrees = 0.0;                            ///< any number of turns
    /// At rest; none: the centre of what is moved.
    std::optional<Eigen::Vector3d> pivot = {};

    bool operator==(const RigidMove&) const = default;
};

/// From rest, at a time.
struct MoveKey
{
    double time = 0.0; ///< [s]
    RigidMove move = {};
};

/// Their times rise.
using MoveKeys = std::vector<MoveKey>;

} // namespace cellwarp::core
