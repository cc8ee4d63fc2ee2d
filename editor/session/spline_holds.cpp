// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/spline_handle.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

/// Of two unit vectors; opposite ones pass through \p any.
Eigen::Vector3d turned_part(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                            double t)
{
    Eigen::Vector3d axis = from.cross(to);
    const double sine = axis.norm(), angle = std::atan2(sine, from.dot(to));
    if (angle == 0.0)
        return to;
    if (!(sine > 1e-12))
        axis = from.unitOrthogonal();
    return Eigen::AngleAxisd(t * angle, axis.normalized()) * from;
}

} // namespace

SplineHolds between(const SplineHolds& from, const SplineHolds& to, double t)
{
    SplineHolds holds = to;
    if (t >= 1.0)
        return holds;
    for (std::size_t k = 0; k < holds.size(); ++k)
    {
        holds[k].place = from[k].place + t * (to[k].place - from[k].place);
        holds[k].tangent = turned_part(from[k].tangent, to[k].tangent, t);
        holds[k].turn = from[k].turn + t * (to[k].turn - from[k].turn);
    }
    return holds;
}

} // namespace cellwarp
