// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/wrap/triangle_pair.h"

namespace cellwarp::core
{

bool can_tell_triangle_pairs()
{
    return false;
}

bool triangles_meet(const std::array<Eigen::Vector3d, 3>&,
                    const std::array<Eigen::Vector3d, 3>&, int)
{
    return false;
}

} // namespace cellwarp::core
