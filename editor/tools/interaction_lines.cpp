// SPDX-License-Identifier: GPL-3.0-or-later
// Rods and curves in the hand: their points, and lines that are drawn.
#include <cmath>
#include <limits>

#include "editor/tools/interaction_state.h"

namespace cellwarp::core
{

namespace
{

/// From how far a point is taken hold of [pixel].
constexpr double kPointReach = 9.0;

constexpr const char* kNoPoint =
    "no point of a rod is active: click one with the tool to move";

/// A ray that goes on behind a face begins so far from it [view].
constexpr double kBehindFace = 1e-4;

} // namespace

const ShownLine* Interaction::State::line_of(const std::string& region) const
{
    for (const ShownLine& line : editing.shape().lines)
        if (line.name == region)
            return &line;
    return nullptr;
}

std::optional<Eigen::Vector3d> Interaction::State::active_place() const
{
    const ShownLine* const line = active_point ? line_of(active) : nullptr;
    return line && *active_point < line->points.size()
               ? std::optional(line->points[*active_point])
               : std::nullopt;
}

std::optional<Interaction::State::PointAt>
Interaction::State::point_at(const Eigen::Vector2d& where) const
{
    if (tool != Tool::Move && tool != Tool::Rotate)
        return std::nullopt;
    std::optional<PointAt> found;
    double nearest = kPointReach;
    for (const ShownLine& line : editing.shape().lines)
    {
        const EditedRegion* const region = document().region(line.name);
        if (!region || (!region->joint && region->points.size() != line.points.size()))
            continue;
        for (std::size_t k = 0; k < line.points.size(); ++k)
        {
            const auto pixels = camera.project(line.points[k]);
            const double away = pixels ? (pixels->head<2>() - where).norm()
                                       : std::numeric_limits<double>::infinity();
            if (away < nearest)
            {
                nearest = away;
                found = PointAt{line.name, k};
            }
        }
    }
    return found;
}

std::optional<Interaction::State::Pull>
Interaction::State::joint_at(const Eigen::Vector2d& where) const
{
    std::optional<Pull> found;
    double nearest = kPointReach;
    for (const ShownLine& line : editing.shape().lines)
    {
        if (!line.is_bone || line.points.empty())
            continue;
        const auto pixels = camera.project(line.points.front());
        const double away = pixels ? (pixels->head<2>() - where).norm()
                                   : std::numeric_limits<double>::infinity();
        if (away < nearest)
        {
            nearest = away;
            found = Pull{line.name, 0, line.points.front()};
        }
    }
    return found;
}

Eigen::Vector3d Interaction::State::at_depth(const Eigen::Vector2d& where,
                                             const Eigen::Vector3d& point) const
{
    const Ray ray = camera.ray(where);
    const Eigen::Vector3d facing = camera.forward();
    return ray.origin +
           ray.direction * ((point - ray.origin).dot(facing) / ray.direction.dot(facing));
}

PointPlacement Interaction::State::point_placement(const HandleDrag& drag) const
{
    const PointDrag& point = *drag.point;
    const RigidMove now = drag.drag.placement();
    PointPlacement to;
    if (!now.translation.isZero(0))
        to.place = before_motion(*active_region(), point.place + now.translation);
    // Turns as they are seen: about the tangent, whichever way it points.
    const double turn =
        std::copysign(now.degrees, now.degrees * now.axis.dot(point.tangent)) +
        point.wheel;
    if (turn != 0.0 && active_region()->role == Role::Rod)
        to.degrees = point.degrees + turn;
    return to;
}

Eigen::Vector3d Interaction::State::through(const Eigen::Vector2d& where) const
{
    const Ray ray = camera.ray(where);
    if (const auto entry = picker.pick(ray))
    {
        const auto exit =
            picker.pick({entry->point + kBehindFace * ray.direction, ray.direction});
        return exit ? Eigen::Vector3d(0.5 * (entry->point + exit->point)) : entry->point;
    }
    return at_depth(where, drawn.empty() ? camera.target() : drawn.back());
}

void Interaction::State::end_drawing(Role role)
{
    RodShape shape;
    for (const Eigen::Vector3d& point : drawn)
        shape.points.push_back(editing.view_frame().to_model(point));
    std::string ends;
    if (!document().handles().stages.back().frames.empty())
        for (const EditedRegion& region : document().regions())
            if (region.is_spline())
                ends += (ends.empty() ? "" : ", ") + region.name;
    active = document().add_line(role, shape);
    if (!ends.empty())
        complain("A new stage begins, and what was posed by " + ends + " stays as it is");
    active_point.reset();
    drawn.clear();
    tool = Tool::Move;
}

void Interaction::State::draw_centre_line()
{
    std::vector<std::uint32_t> near = document().selection().samples();
    if (const EditedRegion* const region = active_region(); near.empty() && region)
        near = region->samples;
    editing.draw_centre_line(near);
    tool = Tool::Move;
}

void Interaction::State::insert_point()
{
    const EditedRegion* const region = active_region();
    const ShownLine* const line = line_of(active);
    if (!region || !line || !active_point || *active_point >= region->points.size())
        throw Error(Fault::Usage, kNoPoint);
    if (region->line->form == SplineStatement::Form::Points)
        throw Error(Fault::Usage,
                    active +
                        " is told by control points: more of them bend it otherwise");
    RodShape shape = shape_of(*region);
    const std::size_t k =
        std::min(*active_point, shape.points.size() - (region->line->is_closed ? 1 : 2));
    // In the middle of the line between two points.
    const double a = region->spline->parameter_of_point(k),
                 b = k + 1 < shape.points.size()
                         ? region->spline->parameter_of_point(k + 1)
                         : region->spline->end();
    shape.points.insert(shape.points.begin() + std::ptrdiff_t(k) + 1,
                        region->rest_at(0.5 * (a + b)));
    document().set_line(active, shape);
    active_point = k + 1;
}

void Interaction::State::release_point(const HoldParts& parts)
{
    if (!active_point)
        throw Error(Fault::Usage, kNoPoint);
    document().release_point(active, *active_point, parts);
}

void Interaction::State::remove_point()
{
    const EditedRegion* const region = active_region();
    if (!region || !active_point || *active_point >= region->points.size())
        throw Error(Fault::Usage, kNoPoint);
    RodShape shape = shape_of(*region);
    shape.points.erase(shape.points.begin() + std::ptrdiff_t(*active_point));
    document().set_line(active, shape);
    active_point.reset();
}

} // namespace cellwarp::core
