// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>

namespace cellwarp::core
{

/// The rotation closest to a matrix, by its singular vectors; of a matrix that mirrors,
/// the last of them is turned over.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& M);

} // namespace cellwarp::core
