// SPDX-License-Identifier: GPL-3.0-or-later
// What a region is turned about. A pivot is a place at rest, so it goes with its region;
// the first turn about it writes it into the move. Until then the hand alone knows it.
#include <cmath>

#include <fmt/format.h>

#include "editor/tools/interaction_state.h"

namespace cellwarp::core
{

namespace
{

/// A pivot within this reach of the border or the middle snaps to it [pixel].
constexpr double kSnapReach = 12.0;

} // namespace

bool Interaction::State::has_pivot(const EditedRegion& region)
{
    return region.moves() && region.role != Role::Pin && !region.joint;
}

bool Interaction::State::is_of(const Pivot& pivot, const EditedRegion& region) const
{
    return pivot.num_stages == document().handles().stages.size() &&
           pivot.num_samples == region.samples.size() && pivot.centre == region.centre;
}

Eigen::Vector3d Interaction::State::pivot_of(const EditedRegion& region) const
{
    if (has_pivot(region))
        for (const Pivot& pivot : pivots)
            if (is_of(pivot, region))
                return pivot.rest;
    return region.pivot();
}

Eigen::Vector3d Interaction::State::place_of(const Eigen::Vector3d& rest,
                                             const EditedRegion& region) const
{
    return editing.view_frame().to_work(motion_of(region)(rest));
}

std::vector<SeenPivot::Mark>
Interaction::State::pivot_marks(const EditedRegion& region) const
{
    std::vector<SeenPivot::Mark> marks = {
        {place_of(region.centre, region), "middle", region.centre}};
    if (region.border)
        marks.insert(marks.begin(),
                     {place_of(*region.border, region), "border", *region.border});
    return marks;
}

/// The active region, if it turns about something; what is wrong is thrown.
const EditedRegion& Interaction::State::turning_region() const
{
    const EditedRegion* const region = active_region();
    if (!region)
        throw Error(Fault::Usage, "no region is active: select samples and press H");
    if (!has_pivot(*region))
        throw Error(Fault::Usage, active + " has no pivot: handles and rods have one");
    if (!region->knows_placement)
        throw Error(Fault::Usage, active + " is not where it can be seen yet");
    return *region;
}

void Interaction::State::set_pivot(const std::optional<Eigen::Vector3d>& rest)
{
    const EditedRegion& region = turning_region();
    const Eigen::Vector3d place = rest.value_or(region.centre);
    if (!place.allFinite())
        return;
    std::erase_if(pivots, [&](const Pivot& pivot) { return is_of(pivot, region); });
    pivots.push_back({document().handles().stages.size(), region.samples.size(),
                      region.centre, place});
}

void Interaction::State::pivot_to_border()
{
    const EditedRegion& region = turning_region();
    if (!region.border)
        throw Error(Fault::Usage,
                    "the border of " + active + " is known when its cells are there");
    set_pivot(region.border);
}

void Interaction::State::take_pivot()
{
    const EditedRegion& region = turning_region();
    // In the hand it is like a pin: it moves, and there is nothing to turn.
    EditedRegion held;
    held.name = region.name;
    held.role = Role::Pin;
    const Eigen::Vector3d place = place_of(pivot_of(region), region);
    // By its middle, so that it comes to where the pointer goes.
    const auto seen = camera.project(place);
    gesture =
        PivotDrag{RegionDrag(held, {}, drag_space(), camera, place, place, DragWay(),
                             seen ? Eigen::Vector2d(seen->head<2>()) : pixel),
                  {}};
    complaint.clear();
    snap_pivot();
}

void Interaction::State::move_pivot()
{
    current<PivotDrag>()->drag.move_to(pixel, modifiers.control);
    snap_pivot();
}

void Interaction::State::snap_pivot()
{
    PivotDrag& held = *current<PivotDrag>();
    held.mark.reset();
    const auto seen = camera.project(held.drag.centre());
    const EditedRegion* const region = active_region();
    // Along an axis, or by a number, it goes just there.
    if (!seen || !region || held.drag.is_typed() ||
        held.drag.way().kind != DragWay::Kind::MoveScreen)
        return;
    double nearest = kSnapReach;
    for (const SeenPivot::Mark& mark : pivot_marks(*region))
        if (const auto at = camera.project(mark.place))
            if (const double away = (at->head<2>() - seen->head<2>()).norm();
                away < nearest)
            {
                nearest = away;
                held.mark = mark;
            }
}

void Interaction::State::let_pivot_go()
{
    const PivotDrag held = *current<PivotDrag>();
    gesture = {};
    attempt(
        [&]
        {
            const Eigen::Vector3d place =
                editing.view_frame().to_model(held.drag.centre());
            set_pivot(held.mark ? held.mark->rest
                                : inverse(motion_of(turning_region()))(place));
        });
}

std::string Interaction::State::pivot_status() const
{
    const PivotDrag& held = *current<PivotDrag>();
    const Eigen::Vector3d place = editing.view_frame().to_model(held.drag.centre());
    return (held.mark ? "Pivot: " + held.mark->name
                      : fmt::format("Pivot at {:.4g}, {:.4g}, {:.4g}", place.x(),
                                    place.y(), place.z())) +
           " (Enter or click: done, Esc: back)";
}

std::optional<Eigen::Vector3d> Interaction::pivot() const
{
    const EditedRegion* const region = state_->active_region();
    return region && State::has_pivot(*region) ? std::optional(state_->pivot_of(*region))
                                               : std::nullopt;
}

void Interaction::set_pivot(const std::optional<Eigen::Vector3d>& rest)
{
    if (!is_busy())
        state_->attempt([&] { state_->set_pivot(rest); });
}

std::optional<SeenPivot> Interaction::seen_pivot() const
{
    const State& s = *state_;
    const EditedRegion* const region = s.active_region();
    if (!region || !State::has_pivot(*region))
        return std::nullopt;
    if (const State::PivotDrag* const held = s.current<State::PivotDrag>())
        return SeenPivot{held->mark ? held->mark->place : held->drag.centre(),
                         s.pivot_marks(*region)};
    if ((s.tool != Tool::Move && s.tool != Tool::Rotate) ||
        s.current<State::HandleDrag>() || s.active_point)
        return std::nullopt;
    return SeenPivot{s.place_of(s.pivot_of(*region), *region), {}};
}

} // namespace cellwarp::core
