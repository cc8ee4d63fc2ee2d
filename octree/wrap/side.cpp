// SPDX-License-Identifier: GPL-3.0-or-later
// The library's filter takes rounded products where they are sure, and exact numbers
// where they are not.
#include "octree/wrap/side.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

namespace cellwarp::core
{

int side_of_line(const double a[2], const double b[2], double x, double y)
{
    using Point = CGAL::Exact_predicates_inexact_constructions_kernel::Point_2;
    return CGAL::orientation(Point(a[0], a[1]), Point(b[0], b[1]), Point(x, y));
}

} // namespace cellwarp::core
