// SPDX-License-Identifier: GPL-3.0-or-later
// What a build without CGAL has instead of skeletons.
#include "octree/wrap/skeleton.h"

namespace cellwarp::core
{

bool has_curve_skeleton()
{
    return false;
}

CurveSkeleton curve_skeleton(const Shape&)
{
    return {};
}

} // namespace cellwarp::core
