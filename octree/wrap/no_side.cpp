// SPDX-License-Identifier: GPL-3.0-or-later
// The sign of a rounded product: wrong at times where a point is within rounding of the
// line.
#include "octree/wrap/side.h"

namespace cellwarp::core
{

int side_of_line(const double a[2], const double b[2], double x, double y)
{
    const double cross = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    return cross > 0 ? 1 : cross < 0 ? -1 : 0;
}

} // namespace cellwarp::core
