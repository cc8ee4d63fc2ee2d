// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/solid_shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
constexpr Colour kBody = {96, 139, 176}, kNet = {120, 166, 110}, kSheet = {120, 166, 110},
                 kSheetToo = {196, 214, 186};

} // namespace

void add_body(const BodyStatement& body, const Motion& pose, int around, Geometry& out)
{
    const Vector3d inertia(body.inertia[0], body.inertia[1], body.inertia[2]);
    out.groups.push_back({body.name, out.num_faces(), 0});
    std::vector<std::vector<Vector3d>> rings;
    if (inertia.maxCoeff() - inertia.minCoeff() <= 1e-9 * inertia.maxCoeff())
    {
        rings = globe(pose, std::sqrt(2.5 * inertia[0] / body.mass), around);
    }
    else
    {
        const Vector3d half =
            (3.0 / body.mass * (Vector3d::Constant(0.5 * inertia.sum()) - inertia))
                .cwiseMax(0.0)
                .cwiseSqrt();
        for (const double side : {-1.0, 1.0})
            rings.push_back(ring(pose(Vector3d(0, 0, side * half[2])),
                                 std::numbers::sqrt2 * half[0] * pose.R.col(0),
                                 std::numbers::sqrt2 * half[1] * pose.R.col(1), 4,
                                 0.25 * std::numbers::pi));
    }
    add_solid(rings, kBody, out);
    out.groups.back().end_face = out.num_faces();
}

void add_net(const NetStatement& net, const std::vector<Vector3d>& points, int around,
             Geometry& out)
{
    constexpr double kThin = 0.05; // of the spring's length
    out.groups.push_back({net.name, out.num_faces(), 0});
    for (const NetStatement::Spring& spring : net.springs)
    {
        const auto rest = [&](std::size_t k)
        { return Vector3d(net.points[k][0], net.points[k][1], net.points[k][2]); };
        const Vector3d a = points[spring.node[0]], b = points[spring.node[1]];
        const double radius =
            kThin * (rest(spring.node[0]) - rest(spring.node[1])).norm();
        const Vector3d t = (b - a).normalized();
        if (!t.allFinite() || t.isZero())
            continue;
        Vector3d n = t.unitOrthogonal();
        const Vector3d m = t.cross(n);
        add_solid({ring(a, radius * n, radius * m, around),
                   ring(b, radius * n, radius * m, around)},
                  kNet, out);
    }
    out.groups.back().end_face = out.num_faces();
}

void add_sheet(const std::string& name, const std::vector<Vector3d>& points, int places,
               Geometry& out)
{
    const int across = places * places;
    const bool is_block = static_cast<int>(points.size()) > across;
    const int last = places - 1;
    out.groups.push_back({name, out.num_faces(), 0});
    // Each face by itself, with sharp edges: from a corner along two ways.
    const auto add_face = [&](int corner, int u, int v)
    {
        const auto first = static_cast<std::uint32_t>(out.samples.size());
        for (int j = 0; j < places; ++j)
            for (int i = 0; i < places; ++i)
            {
                out.samples.push_back(points[idx(corner + i * u + j * v)]);
                // Squares, so that stretch is seen.
                constexpr int kSquare = 4;
                out.colours.push_back((i / kSquare + j / kSquare) % 2 == 0 ? kSheet
                                                                           : kSheetToo);
            }
        const auto row = static_cast<std::uint32_t>(places);
        for (std::uint32_t j = 0; j + 1 < row; ++j)
            for (std::uint32_t i = 0; i + 1 < row; ++i)
            {
                const std::uint32_t a = first + j * row + i;
                out.corners.insert(out.corners.end(), {a, a + 1, a + row + 1, a + row});
                out.face_ends.push_back(out.corners.size());
            }
    };
    const std::array<int, 3> step = {1, places, across};
    if (!is_block)
    {
        add_face(0, step[0], step[1]);
        add_face(0, step[1], step[0]);
    }
    for (std::size_t a = 0; a < 3 && is_block; ++a)
    {
        const int u = step[(a + 1) % 3], v = step[(a + 2) % 3];
        add_face(0, v, u);
        add_face(last * step[a], u, v);
    }
    out.groups.back().end_face = out.num_faces();
}

} // namespace cellwarp::core
