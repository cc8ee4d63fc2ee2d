// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/random_poses.h"

#include <Eigen/Geometry>

#include "tests/support/random.h"

namespace cellwarp::core::support
{

Eigen::Matrix3d random_rotation(std::mt19937& rng)
{
    const Eigen::Vector3d axis = random_vector(rng, 1.0).normalized();
    return rotation_about(axis, random_number(rng, -3.1, 3.1));
}

Pose random_pose(std::mt19937& rng, double size)
{
    return {random_rotation(rng), random_vector(rng, size)};
}

} // namespace cellwarp::core::support
