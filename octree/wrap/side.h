// SPDX-License-Identifier: GPL-3.0-or-later
// On which side of a line a point of the plane lies. Optional: a build without CGAL has
// no_side.cpp in its place.
#pragma once

namespace cellwarp::core
{

/// 1 if the point (x, y) lies left of the line from \p a to \p b, -1 if right, 0 if on
/// it. Exact for all finite numbers; in a build without CGAL only as good as rounded
/// products.
int side_of_line(const double a[2], const double b[2], double x, double y);

} // namespace cellwarp::core
