// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

#include <Eigen/Core>

namespace cellwarp::core
{

/// Where the straight piece from \p a to \p b is nearest to \p x: a share of it in [0,
/// 1].
inline double nearest_share(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& x)
{
    const Eigen::Vector3d along = b - a;
    const double squared = along.squaredNorm();
    return squared > 0 ? std::clamp((x - a).dot(along) / squared, 0.0, 1.0) : 0.0;
}

} // namespace cellwarp::core
