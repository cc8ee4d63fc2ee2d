// SPDX-License-Identifier: GPL-3.0-or-later
// Every way has a second form for when the view makes the first one meaningless: an axis
// that points at the viewer is travelled by moving the pointer up and down, a plane seen
// edge-on by what of the screen's plane lies in it, and a ring seen edge-on is turned
// like a wheel's rim. Which form holds is settled when the drag begins, so nothing ever
// jumps.
#include "editor/tools/gizmo_drag.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "editor/tools/gizmo.h"

namespace cellwarp::core
{

namespace
{

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kAngleStep = 5.0; ///< of snapping [degree]
/// Sine of the angle of sight below which an axis counts as seen end-on, a plane or ring
/// as seen edge-on.
constexpr double kAxisEndOn = 0.1, kPlaneEdgeOn = 0.1, kRingEdgeOn = 0.17;
/// Towards the horizon a pixel is any length; the shape is about 1 large [view].
constexpr double kFarthestDrag = 50.0;
/// Angles nearer the centre than this mean nothing [pixel].
constexpr double kHub = 2.0;
/// Axes whose cosine differs from 1 by less are the same.
constexpr double kSameAxis = 1e-9;

double snapped(double value, double step)
{
    return step > 0 ? step * std::round(value / step) : value;
}

} // namespace

GizmoDrag::GizmoDrag(const Camera& camera, const Eigen::Vector3d& centre,
                     const DragWay& way, const Eigen::Vector2d& pixel)
    : camera_(camera), centre_(centre), way_(way), start_(pixel), pixel_(pixel)
{
    const Eigen::Vector3d to_centre = centre - camera.eye();
    sight_ = camera.is_perspective() && to_centre.norm() > 0
                 ? Eigen::Vector3d(to_centre.normalized())
                 : camera.forward();
    const double cosine = std::abs(sight_[way.axis]);
    is_degenerate_ = (way.kind == DragWay::Kind::MoveAxis &&
                      1 - cosine * cosine < kAxisEndOn * kAxisEndOn) ||
                     (way.kind == DragWay::Kind::MovePlane && cosine < kPlaneEdgeOn) ||
                     (way.kind == DragWay::Kind::TurnAxis && cosine < kRingEdgeOn);
    last_angle_ = angle(pixel).value_or(0.0);
}

Eigen::Vector3d GizmoDrag::turn_axis() const
{
    switch (way_.kind)
    {
    case DragWay::Kind::TurnAxis:
        return Eigen::Vector3d::Unit(way_.axis);
    case DragWay::Kind::TurnFree:
    {
        const Eigen::Vector2d way = pixel_ - start_;
        const Eigen::Vector3d axis = way.x() * camera_.up() + way.y() * camera_.right();
        return axis.norm() > 0 ? Eigen::Vector3d(axis.normalized()) : camera_.up();
    }
    default:
        return -camera_.forward();
    }
}

/// Where on the axis the pointer is: the point of the axis' line closest to its ray.
std::optional<double> GizmoDrag::along_axis(const Eigen::Vector2d& pixel) const
{
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(way_.axis);
    if (is_degenerate_) // upwards is away from the viewer
        return (start_.y() - pixel.y()) * camera_.pixel_size(centre_) *
               (axis.dot(sight_) < 0 ? -1.0 : 1.0);
    const Ray ray = camera_.ray(pixel);
    const double cosine = axis.dot(ray.direction);
    const double sine_squared = 1.0 - cosine * cosine;
    if (!(sine_squared > 1e-6))
        return std::nullopt;
    const Eigen::Vector3d between = ray.origin - centre_;
    const double t =
        (axis.dot(between) - cosine * ray.direction.dot(between)) / sine_squared;
    // The closest point of the ray must lie before the eye.
    if (!(cosine * t - ray.direction.dot(between) > 0) || !(std::abs(t) < kFarthestDrag))
        return std::nullopt;
    return t;
}

std::optional<Eigen::Vector3d> GizmoDrag::in_plane(const Eigen::Vector2d& pixel,
                                                   const Eigen::Vector3d& normal) const
{
    const Ray ray = camera_.ray(pixel);
    const double t = normal.dot(centre_ - ray.origin) / normal.dot(ray.direction);
    const Eigen::Vector3d x = ray.origin + t * ray.direction;
    if (!(t > 0) || !((x - centre_).norm() < kFarthestDrag))
        return std::nullopt;
    return x;
}

/// Where on the ring the pointer is, up to whole turns [rad].
std::optional<double> GizmoDrag::angle(const Eigen::Vector2d& pixel) const
{
    if (way_.kind == DragWay::Kind::TurnView)
    {
        const auto seen = camera_.project(centre_);
        if (!seen || !((pixel - seen->head<2>()).norm() > kHub))
            return std::nullopt;
        return std::atan2(seen->y() - pixel.y(), pixel.x() - seen->x());
    }
    if (way_.kind == DragWay::Kind::TurnFree)
        return (pixel - start_).norm() / kRingRadius;
    if (way_.kind != DragWay::Kind::TurnAxis)
        return std::nullopt;
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(way_.axis);
    if (is_degenerate_)
    {
        // The rim's nearest point goes this way, in pixels.
        const Eigen::Vector3d rim = axis.cross(-sight_);
        const Eigen::Vector2d way(camera_.right().dot(rim), -camera_.up().dot(rim));
        return way.normalized().dot(pixel - start_) / kRingRadius;
    }
    const auto x = in_plane(pixel, axis);
    if (!x || !((*x - centre_).norm() > kHub * camera_.pixel_size(centre_)))
        return std::nullopt;
    const Eigen::Vector3d spoke = *x - centre_;
    return std::atan2(spoke[(way_.axis + 2) % 3], spoke[(way_.axis + 1) % 3]);
}

void GizmoDrag::move_to(const Eigen::Vector2d& pixel)
{
    if (!pixel.allFinite())
        return;
    pixel_ = pixel;
    if (way_.turns())
    {
        const auto now = angle(pixel);
        if (!now)
            return;
        const bool winds = way_.kind != DragWay::Kind::TurnFree && !is_degenerate_;
        turned_ += winds ? std::remainder(*now - last_angle_, 2.0 * std::numbers::pi)
                         : *now - last_angle_;
        last_angle_ = *now;
        return;
    }
    if (way_.kind == DragWay::Kind::MoveAxis)
    {
        const auto from = along_axis(start_), to = along_axis(pixel);
        if (from && to)
            shift_ = (*to - *from) * Eigen::Vector3d::Unit(way_.axis);
        return;
    }
    const bool is_screen = way_.kind == DragWay::Kind::MoveScreen || is_degenerate_;
    const Eigen::Vector3d normal =
        is_screen ? camera_.forward() : Eigen::Vector3d(Eigen::Vector3d::Unit(way_.axis));
    const auto from = in_plane(start_, normal), to = in_plane(pixel, normal);
    if (!from || !to)
        return;
    shift_ = *to - *from;
    if (way_.kind == DragWay::Kind::MovePlane)
        shift_[way_.axis] = 0.0;
}

DragAmount GizmoDrag::amount(const DragEntry& entry) const
{
    DragAmount amount;
    if (way_.turns())
    {
        amount.axis = turn_axis();
        amount.degrees = entry.typed.value_or(
            snapped(turned_ / kDegree, entry.snap > 0 ? kAngleStep : 0.0));
        return amount;
    }
    // The directions that a typed number goes along, or that lengths are rounded along.
    Eigen::Vector3d first = Eigen::Vector3d::Unit(way_.axis), second = first;
    if (way_.kind == DragWay::Kind::MovePlane)
    {
        first = Eigen::Vector3d::Unit(way_.axis == 0 ? 1 : 0);
        second = Eigen::Vector3d::Unit(way_.axis == 2 ? 1 : 2);
    }
    else if (way_.kind == DragWay::Kind::MoveScreen)
    {
        first = camera_.right();
        second = camera_.up();
    }
    if (entry.typed)
        amount.shift = *entry.typed * first;
    else if (entry.snap > 0)
    {
        amount.shift = snapped(first.dot(shift_), entry.snap) * first;
        if (way_.kind != DragWay::Kind::MoveAxis)
            amount.shift += snapped(second.dot(shift_), entry.snap) * second;
    }
    else
        amount.shift = shift_;
    return amount;
}

RigidMove moved(const RigidMove& start, const Eigen::Vector3d& shift,
                const Eigen::Vector3d& axis, double degrees)
{
    RigidMove result = start;
    result.translation += shift;
    if (degrees == 0)
        return result;
    const double cosine = start.axis.dot(axis);
    if (start.degrees == 0)
    {
        result.axis = axis;
        result.degrees = degrees;
    }
    else if (1 - std::abs(cosine) < kSameAxis)
        result.degrees += cosine < 0 ? -degrees : degrees;
    else
    {
        const Eigen::AngleAxisd turn(
            Eigen::AngleAxisd(degrees * kDegree, axis) *
            Eigen::AngleAxisd(start.degrees * kDegree, start.axis));
        result.axis = turn.axis();
        result.degrees = turn.angle() / kDegree;
    }
    return result;
}

} // namespace cellwarp::core
