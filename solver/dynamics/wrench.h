// SPDX-License-Identifier: GPL-3.0-or-later
// A force and a couple at a place of an object.
#pragma once

#include <Eigen/Core>

namespace cellwarp::core
{

struct Wrench
{
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< [N]
    Eigen::Vector3d couple = Eigen::Vector3d::Zero(); ///< about the place [N m]
};

} // namespace cellwarp::core
