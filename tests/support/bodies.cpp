// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/bodies.h"

#include <cmath>

#include <Eigen/LU>

#include "io/formats/face_triangles.h"
#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "tests/support/files.h"

namespace cellwarp::core::support
{

namespace
{

/// A prism over a polygon, 1 high. \p corners: counterclockwise; \p parts: triangles
/// that fill it.
Shape prism(const std::vector<Eigen::Vector2d>& corners,
            const std::vector<Triangle>& parts)
{
    Shape shape;
    for (const double z : {0.0, 1.0})
        for (const Eigen::Vector2d& c : corners)
            shape.samples.emplace_back(c.x(), c.y(), z);
    const std::uint32_t n = static_cast<std::uint32_t>(corners.size());
    for (std::uint32_t i = 0; i < n; ++i)
    {
        const std::uint32_t next = (i + 1) % n;
        shape.triangles.push_back({i, next, n + next});
        shape.triangles.push_back({i, n + next, n + i});
    }
    for (const Triangle& t : parts)
    {
        shape.triangles.push_back({t[2], t[1], t[0]});
        shape.triangles.push_back({n + t[0], n + t[1], n + t[2]});
    }
    return shape;
}

} // namespace

Shape angle(double width)
{
    return prism({{0, 0}, {4, 0}, {4, width}, {1 + width, width}, {1 + width, 2}, {0, 2}},
                 {{0, 1, 2}, {0, 2, 3}, {0, 3, 5}, {3, 4, 5}});
}

Shape hand()
{
    const Geometry geometry = read_geometry(samples_folder() + "/hand.ply").geometry;
    return {geometry.samples, triangles_of(geometry)};
}

Shape turned(Shape shape, const Eigen::Matrix3d& Q)
{
    Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY);
    for (Eigen::Vector3d& x : shape.samples)
    {
        x = Q * x;
        low = low.cwiseMin(x);
    }
    for (Eigen::Vector3d& x : shape.samples)
        x -= low;
    if (Q.determinant() < 0)
        for (Triangle& t : shape.triangles)
            std::swap(t[1], t[2]);
    return shape;
}

} // namespace cellwarp::core::support
