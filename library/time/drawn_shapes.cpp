// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/drawn_shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
constexpr Colour kObstacle = {172, 176, 184};

} // namespace

/// In one colour, closed at its ends.
void add_solid(const std::vector<std::vector<Vector3d>>& rings, const Colour& colour,
               Geometry& out)
{
    add_rings(rings, std::vector<Colour>(rings.front().size(), colour), false, out);
}

std::vector<std::vector<Vector3d>> globe(const Motion& pose, double radius, int around)
{
    const int count = std::max(4, around);
    std::vector<std::vector<Vector3d>> rings;
    for (int k = 0; k <= count; ++k)
    {
        // The poles are small rings.
        const double polar =
            std::clamp(std::numbers::pi * k / count, 1e-3, std::numbers::pi - 1e-3);
        rings.push_back(ring(pose(Vector3d(0, 0, -radius * std::cos(polar))),
                             radius * std::sin(polar) * pose.R.col(0),
                             radius * std::sin(polar) * pose.R.col(1), 2 * count));
    }
    return rings;
}

std::vector<Vector3d> ring(const Vector3d& middle, const Vector3d& a, const Vector3d& b,
                           int around, double phase)
{
    std::vector<Vector3d> out;
    for (int k = 0; k < around; ++k)
    {
        const double angle = 2.0 * std::numbers::pi * k / around + phase;
        out.push_back(middle + std::cos(angle) * a + std::sin(angle) * b);
    }
    return out;
}

void add_rings(const std::vector<std::vector<Vector3d>>& rings,
               std::span<const Colour> colours, bool is_closed, Geometry& out)
{
    const auto first = static_cast<std::uint32_t>(out.samples.size());
    const auto count = static_cast<std::uint32_t>(colours.size());
    for (const std::vector<Vector3d>& one : rings)
    {
        out.samples.insert(out.samples.end(), one.begin(), one.end());
        out.colours.insert(out.colours.end(), colours.begin(), colours.end());
    }
    const auto end_face = [&] { out.face_ends.push_back(out.corners.size()); };
    const auto corner = [&](std::size_t ring, std::uint32_t k) {
        return first + static_cast<std::uint32_t>(ring % rings.size()) * count +
               k % count;
    };
    for (std::size_t i = 0; i + (is_closed ? 0 : 1) < rings.size(); ++i)
        for (std::uint32_t k = 0; k < count; ++k)
        {
            out.corners.insert(
                out.corners.end(),
                {corner(i, k), corner(i, k + 1), corner(i + 1, k + 1), corner(i + 1, k)});
            end_face();
        }
    for (const bool is_begin : {true, false})
    {
        if (is_closed)
            break;
        for (std::uint32_t k = 0; k < count; ++k)
            out.corners.push_back(is_begin ? corner(0, count - k)
                                           : corner(rings.size() - 1, k));
        end_face();
    }
}

void add_ball(const Vector3d& centre, double radius, int around, Geometry& out)
{
    out.groups.push_back({"obstacle", out.num_faces(), 0});
    add_solid(globe({Eigen::Matrix3d::Identity(), centre}, radius, around), kObstacle,
              out);
    out.groups.back().end_face = out.num_faces();
}

void add_mesh(const Geometry& mesh, Geometry& out)
{
    const auto first = static_cast<std::uint32_t>(out.samples.size());
    const std::uint64_t corners = out.corners.size();
    out.groups.push_back({"obstacle", out.num_faces(), 0});
    out.samples.insert(out.samples.end(), mesh.samples.begin(), mesh.samples.end());
    out.colours.resize(out.samples.size(), kObstacle);
    for (const std::uint32_t corner : mesh.corners)
        out.corners.push_back(first + corner);
    for (std::size_t f = 0; f < mesh.num_faces(); ++f)
        out.face_ends.push_back(corners + mesh.face_ends[f]);
    out.groups.back().end_face = out.num_faces();
}

void add_tile(const Vector3d& normal, double offset, const Vector3d& middle, double half,
              Geometry& out)
{
    const Vector3d n = normal.normalized(), a = n.unitOrthogonal(), b = n.cross(a);
    const Vector3d at = middle - (n.dot(middle) - offset / normal.norm()) * n;
    // A thin plate: both of its faces have a side.
    const double thin = 1e-3 * half;
    out.groups.push_back({"obstacle", out.num_faces(), 0});
    add_solid({ring(at - thin * n, half * a, half * b, 4, 0.25 * std::numbers::pi),
               ring(at, half * a, half * b, 4, 0.25 * std::numbers::pi)},
              kObstacle, out);
    out.groups.back().end_face = out.num_faces();
}

} // namespace cellwarp::core
