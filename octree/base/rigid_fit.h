// SPDX-License-Identifier: GPL-3.0-or-later
// The rigid motion that takes places to other places best.
#pragma once

#include <span>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

/// The rigid motion with the least sum of squared distances from the images of \p from
/// to \p to. Of several that are as good, where the places lie in a line or are one, that
/// with the least turn. Exactly the identity where no place moves. \pre as many of both;
/// none: the identity
Motion rigid_fit(std::span<const Eigen::Vector3d> from,
                 std::span<const Eigen::Vector3d> to);

/// The same among the motions that turn about \p axis, a unit vector, alone.
Motion rigid_fit_about(const Eigen::Vector3d& axis, std::span<const Eigen::Vector3d> from,
                       std::span<const Eigen::Vector3d> to);

} // namespace cellwarp::core
