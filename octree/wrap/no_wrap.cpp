// SPDX-License-Identifier: GPL-3.0-or-later
// What a build without CGAL has instead of a wrap.
#include "octree/wrap/wrap.h"

namespace cellwarp::core
{

Shape alpha_wrap(std::span<const Eigen::Vector3d>, double, double)
{
    return {};
}

Shape alpha_wrap(const Shape&, double, double)
{
    return {};
}

} // namespace cellwarp::core
