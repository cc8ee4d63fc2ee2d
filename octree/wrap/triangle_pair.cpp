// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles that share an edge have more in common if they lie in one plane, on one side
// of it; those that share a corner, if the opposite edge of one meets the other.
#include "octree/wrap/triangle_pair.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/intersections.h>

namespace cellwarp::core
{

namespace
{

using PairKernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using PairPoint = PairKernel::Point_3;

struct Corners
{
    PairPoint a, b, c;

    explicit Corners(const std::array<Eigen::Vector3d, 3>& of)
        : a(of[0].x(), of[0].y(), of[0].z()), b(of[1].x(), of[1].y(), of[1].z()),
          c(of[2].x(), of[2].y(), of[2].z())
    {
    }
    PairKernel::Triangle_3 triangle() const { return {a, b, c}; }
    bool is_flat() const { return CGAL::collinear(a, b, c); }
    CGAL::Orientation side_of(const PairPoint& point) const
    {
        return CGAL::orientation(a, b, c, point);
    }
};

/// Whether the plane of \p a parts it from all corners of \p b but the shared ones.
bool is_parted(const Corners& a, const Corners& b, int shared)
{
    const CGAL::Orientation side = a.side_of(b.c);
    return side != CGAL::COPLANAR && (shared == 2 || a.side_of(b.b) == side) &&
           (shared >= 1 || a.side_of(b.a) == side);
}

} // namespace

bool can_tell_triangle_pairs()
{
    return true;
}

bool triangles_meet(const std::array<Eigen::Vector3d, 3>& a,
                    const std::array<Eigen::Vector3d, 3>& b, int shared)
{
    const Corners s(a), t(b);
    if (is_parted(s, t, shared) || is_parted(t, s, shared))
        return false;
    if (s.is_flat() || t.is_flat())
        return false;
    switch (shared)
    {
    case 0:
        return CGAL::do_intersect(s.triangle(), t.triangle());
    case 1:
        return CGAL::do_intersect(PairKernel::Segment_3(s.b, s.c), t.triangle()) ||
               CGAL::do_intersect(PairKernel::Segment_3(t.b, t.c), s.triangle());
    case 2: // in one plane: no side parts them
        return CGAL::coplanar_orientation(s.a, s.b, s.c, t.c) == CGAL::POSITIVE;
    default:
        return true;
    }
}

} // namespace cellwarp::core
