// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/gizmo.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace cellwarp::core
{

namespace
{

// On the screen [pixel].
constexpr double kArrowStart = 20.0, kArrowEnd = 95.0;
constexpr double kHeadLength = 14.0, kHeadWidth = 6.0; ///< of an arrow, half of it
constexpr double kSquareNear = 30.0, kSquareFar = 46.0;
constexpr double kScreenRadius = 14.0, kOuterRadius = 95.0;
constexpr double kAim = 8.0; ///< how well a hand aims

constexpr int kSides = 64; ///< of a circle
/// A part is left out if less of it than this is seen, of its length or width.
constexpr double kEndOn = 0.12;

std::vector<Eigen::Vector3d> circle(const Eigen::Vector3d& centre,
                                    const Eigen::Vector3d& a, const Eigen::Vector3d& b)
{
    std::vector<Eigen::Vector3d> line;
    for (int i = 0; i < kSides; ++i)
    {
        const double angle = 2.0 * std::numbers::pi * i / kSides;
        line.push_back(centre + std::cos(angle) * a + std::sin(angle) * b);
    }
    return line;
}

GizmoPart facing_circle(GizmoPart::Kind kind, int axis, const Eigen::Vector3d& centre,
                        const Camera& camera, double radius)
{
    return {kind, axis, circle(centre, radius * camera.right(), radius * camera.up()),
            true};
}

Eigen::Vector3d towards(const Eigen::Vector3d& centre, const Camera& camera)
{
    return camera.is_perspective() ? (centre - camera.eye()).normalized()
                                   : camera.forward();
}

double segment_distance(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                        const Eigen::Vector2d& x)
{
    const Eigen::Vector2d way = b - a;
    const double squared = way.squaredNorm();
    const double t = squared > 0 ? std::clamp(way.dot(x - a) / squared, 0.0, 1.0) : 0.0;
    return (a + t * way - x).norm();
}

/// How far a pixel is from a part's line, on the screen [pixel]. The far side of a ring
/// counts as farther than the near side of any other.
double line_distance(const GizmoPart& part, const Camera& camera,
                     const Eigen::Vector2d& pixel)
{
    double depth = 0.0; // of the middle
    for (const Eigen::Vector3d& x : part.line)
        depth += camera.forward().dot(x) / static_cast<double>(part.line.size());
    double best = std::numeric_limits<double>::infinity();
    const std::size_t count = part.line.size();
    for (std::size_t i = 0; i + (part.is_closed ? 0 : 1) < count; ++i)
    {
        const Eigen::Vector3d& from = part.line[i];
        const auto a = camera.project(from);
        const auto b = camera.project(part.line[(i + 1) % count]);
        if (!a || !b)
            continue;
        const double distance = segment_distance(a->head<2>(), b->head<2>(), pixel);
        const double size = camera.pixel_size(from);
        const bool is_behind = part.kind == GizmoPart::Kind::Ring &&
                               camera.forward().dot(from) > depth + kAim * size;
        if (distance <= kAim)
            best = std::min(best, distance + (is_behind ? kAim : 0.0));
    }
    return best;
}

/// Of parts that lie over each other the one that is harder to hit wins.
int priority(GizmoPart::Kind kind)
{
    switch (kind)
    {
    case GizmoPart::Kind::Screen:
        return 0;
    case GizmoPart::Kind::Plane:
        return 1;
    case GizmoPart::Kind::Axis:
        return 2;
    case GizmoPart::Kind::Ring:
        return 3;
    }
    return 4;
}

} // namespace

std::vector<GizmoPart> move_gizmo(const Eigen::Vector3d& centre, const Camera& camera)
{
    std::vector<GizmoPart> parts;
    if (!camera.project(centre))
        return parts;
    const double size = camera.pixel_size(centre);
    const Eigen::Vector3d view = towards(centre, camera);
    for (int k = 0; k < 3; ++k)
    {
        const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k);
        const Eigen::Vector3d aside = axis.cross(view);
        if (!(aside.norm() > kEndOn))
            continue;
        const Eigen::Vector3d tip = centre + kArrowEnd * size * axis;
        const Eigen::Vector3d neck = tip - kHeadLength * size * axis;
        const Eigen::Vector3d half = kHeadWidth * size * aside.normalized();
        parts.push_back(
            {GizmoPart::Kind::Axis,
             k,
             {centre + kArrowStart * size * axis, tip, neck + half, neck - half, tip}});
    }
    for (int k = 0; k < 3; ++k)
    {
        if (!(std::abs(view[k]) > kEndOn))
            continue;
        const Eigen::Vector3d a = size * Eigen::Vector3d::Unit((k + 1) % 3);
        const Eigen::Vector3d b = size * Eigen::Vector3d::Unit((k + 2) % 3);
        const double low = kSquareNear, high = kSquareFar;
        parts.push_back({GizmoPart::Kind::Plane,
                         k,
                         {centre + low * a + low * b, centre + high * a + low * b,
                          centre + high * a + high * b, centre + low * a + high * b},
                         true});
    }
    parts.push_back(
        facing_circle(GizmoPart::Kind::Screen, 0, centre, camera, kScreenRadius * size));
    return parts;
}

std::vector<GizmoPart> turn_gizmo(const Eigen::Vector3d& centre, const Camera& camera)
{
    std::vector<GizmoPart> parts;
    if (!camera.project(centre))
        return parts;
    const double size = camera.pixel_size(centre);
    for (int k = 0; k < 3; ++k)
        parts.push_back(
            {GizmoPart::Kind::Ring, k,
             circle(centre, kRingRadius * size * Eigen::Vector3d::Unit((k + 1) % 3),
                    kRingRadius * size * Eigen::Vector3d::Unit((k + 2) % 3)),
             true});
    parts.push_back(
        facing_circle(GizmoPart::Kind::Ring, 3, centre, camera, kOuterRadius * size));
    parts.push_back(
        facing_circle(GizmoPart::Kind::Screen, 0, centre, camera, kScreenRadius * size));
    return parts;
}

bool is_inside(std::span<const Eigen::Vector2d> line, const Eigen::Vector2d& pixel)
{
    bool inside = false;
    for (std::size_t i = 0; i < line.size(); ++i)
    {
        const Eigen::Vector2d& a = line[i];
        const Eigen::Vector2d& b = line[i + 1 < line.size() ? i + 1 : 0];
        // Half open, so that a corner counts for one of its two sides.
        if ((a.y() > pixel.y()) == (b.y() > pixel.y()))
            continue;
        const double t = (pixel.y() - a.y()) / (b.y() - a.y());
        inside ^= pixel.x() < a.x() + t * (b.x() - a.x());
    }
    return inside;
}

std::optional<std::size_t> gizmo_part_at(std::span<const GizmoPart> parts,
                                         const Camera& camera,
                                         const Eigen::Vector2d& pixel)
{
    std::optional<std::size_t> best;
    double best_distance = 0.0;
    for (std::size_t i = 0; i < parts.size(); ++i)
    {
        const GizmoPart& part = parts[i];
        double distance = line_distance(part, camera, pixel);
        if (part.kind == GizmoPart::Kind::Screen || part.kind == GizmoPart::Kind::Plane)
        {
            std::vector<Eigen::Vector2d> line;
            for (const Eigen::Vector3d& x : part.line)
                if (const auto seen = camera.project(x))
                    line.push_back(seen->head<2>());
            // Their lines are no part of them: an arrow passes close by.
            distance =
                is_inside(line, pixel) ? 0.0 : std::numeric_limits<double>::infinity();
        }
        if (!std::isfinite(distance))
            continue;
        const int rank = priority(part.kind);
        const int best_rank = best ? priority(parts[*best].kind) : 0;
        if (!best || rank < best_rank || (rank == best_rank && distance < best_distance))
        {
            best = i;
            best_distance = distance;
        }
    }
    return best;
}

} // namespace cellwarp::core
