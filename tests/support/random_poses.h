// SPDX-License-Identifier: GPL-3.0-or-later
// Rotations and rigid motions by a seeded generator.
#pragma once

#include <random>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"

namespace cellwarp::core::support
{

Eigen::Matrix3d random_rotation(std::mt19937& rng);
Pose random_pose(std::mt19937& rng, double size);

} // namespace cellwarp::core::support
