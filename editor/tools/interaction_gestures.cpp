// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include "editor/tools/interaction_state.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// What moves less between press and release is a click [pixel].
constexpr double kClickReach = 4.0;
constexpr std::chrono::seconds kComplaintLasts{6};

std::string verb_of(SelectMode mode)
{
    return mode == SelectMode::Add        ? "Add"
           : mode == SelectMode::Subtract ? "Subtract"
                                          : "Select";
}

std::string word_of(SelectGesture::Kind kind)
{
    return kind == SelectGesture::Kind::Box     ? "box"
           : kind == SelectGesture::Kind::Lasso ? "lasso"
                                                : "brush";
}

SelectMode mode_of(const Modifiers& modifiers)
{
    return modifiers.control ? SelectMode::Subtract
           : modifiers.shift ? SelectMode::Add
                             : SelectMode::Replace;
}

DragWay way_of(const GizmoPart& part, bool turns)
{
    switch (part.kind)
    {
    case GizmoPart::Kind::Axis:
        return {DragWay::Kind::MoveAxis, part.axis};
    case GizmoPart::Kind::Plane:
        return {DragWay::Kind::MovePlane, part.axis};
    case GizmoPart::Kind::Screen:
        return {turns ? DragWay::Kind::TurnFree : DragWay::Kind::MoveScreen, 0};
    case GizmoPart::Kind::Ring:
        return part.axis == 3 ? DragWay{DragWay::Kind::TurnView, 0}
                              : DragWay{DragWay::Kind::TurnAxis, part.axis};
    }
    return {};
}

} // namespace

std::string Interaction::State::Choice::name() const
{
    return verb_of(mode) + " by " + word_of(gesture.kind());
}

void Interaction::State::complain(const std::string& what)
{
    complaint = what;
    complaint_ends = Clock::now() + kComplaintLasts;
}

const EditedRegion*
Interaction::State::region_at(const std::optional<Picked>& picked) const
{
    const int index = picked ? document().region_of(picked->sample) : -1;
    return index < 0 ? nullptr : &document().regions()[idx(index)];
}

std::vector<GizmoPart> Interaction::State::gizmo() const
{
    const EditedRegion* const region = active_region();
    if (!region || !region->moves() ||
        (tool != Tool::Move && tool != Tool::Rotate && !current<HandleDrag>()) ||
        current<PivotDrag>())
        return {};
    const HandleDrag* const handle_drag = current<HandleDrag>();
    const std::optional<Eigen::Vector3d> point = active_place();
    const Eigen::Vector3d centre = handle_drag ? handle_drag->drag.centre()
                                   : point     ? *point
                                               : place_of(pivot_of(*region), *region);
    const bool turns =
        handle_drag ? handle_drag->drag.way().turns() : tool_turns(*region);
    std::vector<GizmoPart> parts =
        turns ? turn_gizmo(centre, camera) : move_gizmo(centre, camera);
    if (point) // it turns about its own tangent alone
        std::erase_if(parts, [](const GizmoPart& part)
                      { return part.kind == GizmoPart::Kind::Ring && part.axis != 3; });
    const std::optional<GizmoPart>& marked = handle_drag ? handle_drag->part : hot;
    for (GizmoPart& part : parts)
        part.is_hot = marked && part.is_same(*marked);
    return parts;
}

/// Which is in the hand as a whole, by its only point.
bool Interaction::State::is_joint(const std::string& region) const
{
    const EditedRegion* const found = document().region(region);
    return found && found->joint;
}

bool Interaction::State::tool_turns(const EditedRegion& region) const
{
    return tool == Tool::Rotate && region.role != Role::Pin;
}

std::optional<GizmoPart> Interaction::State::part_at(const Eigen::Vector2d& where) const
{
    const std::vector<GizmoPart> parts = gizmo();
    const auto index = gizmo_part_at(parts, camera, where);
    return index ? std::optional(parts[*index]) : std::nullopt;
}

DragSpace Interaction::State::drag_space() const
{
    return {std::ldexp(1.0, editing.view_frame().exponent),
            snap_step(document().box().size().maxCoeff())};
}

void Interaction::State::take(const std::string& name, const DragStart& start)
{
    complaint.clear();
    const EditedRegion* const region = document().region(name);
    if (!region)
        return complain("no region is active: select samples and press H");
    if (start.way.turns() && region->role == Role::Pin)
        return complain(name + " is a pin: it turns as it likes");
    const ShownLine* const line = start.point ? line_of(name) : nullptr;
    if (start.point && (!line || *start.point >= line->points.size()))
        return complain(name + " is not where it can be seen yet");
    std::string why;
    if (!(start.point ? editing.begin_point_drag(name, *start.point, &why)
                      : editing.begin_drag(name, &why)))
        return complain(why);
    active = name;
    active_point = start.point;
    EditedRegion held = *region;
    const Eigen::Vector3d pivot = pivot_of(*region);
    RigidMove turned = about(pivot, *region);
    Eigen::Vector3d centre = place_of(pivot, *region);
    std::optional<PointDrag> point;
    if (start.point)
    {
        const std::size_t k = *start.point;
        centre = line->points[k];
        held.placement = turned = {};
        const EditedPoint& edited = region->points[k];
        point = PointDrag{k, editing.view_frame().to_model(centre), line->tangents[k],
                          edited.parts.twist ? edited.degrees : line->turns[k]};
    }
    gesture = HandleDrag{RegionDrag(held, turned, drag_space(), camera, centre,
                                    start.grabbed, start.way, start.pixel),
                         start.is_by_key, start.part, point};
}

void Interaction::State::lead()
{
    const HandleDrag& drag = *current<HandleDrag>();
    if (drag.point)
        editing.drag_point_to(point_placement(drag));
    else
        editing.drag_to(drag.drag.placement());
}

void Interaction::State::let_go()
{
    lead();
    gesture = {};
    const std::uint64_t before = document().result_revision();
    attempt([&] { editing.end_drag(); });
    num_drags += document().result_revision() != before;
}

void Interaction::State::start_choice(SelectGesture::Kind kind, const Press& press)
{
    complaint.clear();
    preview.reset();
    gesture = Choice{SelectGesture({kind, goes_through(), brush_radius}, camera,
                                   editing.shape(), press.pixel),
                     mode_of(press.modifiers)};
}

/// Looks at what the gesture came over: while a brush paints, and after any release.
void Interaction::State::update_choice()
{
    Choice* const choice = current<Choice>();
    if (!choice ||
        (!choice->is_released && choice->gesture.kind() != SelectGesture::Kind::Brush))
        return;
    if (!choice->is_released)
        choice->gesture.collect(editing.shape());
    const bool is_done = choice->gesture.look(picker, kLooksAtOnce);
    if (is_done && choice->is_released)
        return end_choice();
    preview = combined(document().selection(), choice->gesture.chosen(), choice->mode);
}

void Interaction::State::end_choice()
{
    const Choice& choice = *current<Choice>();
    const Selection selection =
        combined(document().selection(), choice.gesture.chosen(), choice.mode);
    const std::string name = choice.name();
    // Behind what a brush paints there is always something.
    num_left_out = choice.gesture.kind() == SelectGesture::Kind::Brush
                       ? 0
                       : choice.gesture.num_hidden();
    gesture = {};
    preview.reset();
    attempt([&] { document().select(selection, name); });
    left_out_at = document().revision();
}

void Interaction::State::finish_selecting()
{
    if (Choice* const choice = current<Choice>(); choice && choice->is_released)
    {
        while (!choice->gesture.look(picker, kLooksAtOnce))
            continue;
        end_choice();
    }
    if (!spread || editing.dragged())
        return;
    neighbours.wait();
    if (const Neighbours* const around = neighbours.get())
        attempt([&] { run_spread(*around); });
}

void Interaction::State::click(const Press& press)
{
    if (tool == Tool::Draw)
    {
        // The last point once more: done, as by Enter.
        const auto last = drawn.empty() ? std::nullopt : camera.project(drawn.back());
        if (last && (last->head<2>() - press.pixel).norm() <= kClickReach)
        {
            if (drawn.size() > 1)
                attempt([&] { end_drawing(Role::Rod); });
            return;
        }
        drawn.push_back(through(press.pixel));
        return;
    }
    if (tool == Tool::Move || tool == Tool::Rotate)
    {
        if (const EditedRegion* const region = region_at(press.picked))
        {
            active = region->name;
            active_point.reset();
        }
        return;
    }
    Selection chosen(document().selection().num_samples());
    if (press.picked)
        chosen.add(press.picked->sample);
    const SelectMode mode = mode_of(press.modifiers);
    attempt(
        [&]
        {
            document().select(combined(document().selection(), chosen, mode),
                              press.picked ? verb_of(mode) + " by click"
                                           : "Select nothing");
        });
}

void Interaction::State::press(Button button, const Modifiers& with)
{
    if (HandleDrag* const handle_drag = current<HandleDrag>())
    {
        if (button == Button::Right)
            return cancel();
        if (button == Button::Left && handle_drag->is_by_key)
        {
            handle_drag->drag.move_to(pixel, with.control);
            let_go();
        }
        return;
    }
    if (current<PivotDrag>() && button == Button::Left)
    {
        move_pivot();
        return let_pivot_go();
    }
    if ((current<Choice>() || current<PivotDrag>()) && button == Button::Right)
        return cancel();
    const std::optional<CameraMotion> motion = camera_motion(navigation, button, with);
    if (!motion || !is_idle()) // the view turns while neighbours are still being found
        finish_selecting();
    if (!is_idle())
        return;
    if (!picker.is_ready()) // of a shape that has just been opened
        update_picker(true);
    const std::optional<Picked> picked = picker.pick(camera.ray(pixel));
    const auto depth =
        picked ? std::optional(picked->point) : std::optional<Eigen::Vector3d>();
    if (motion)
    {
        gesture = Look{*motion, button, pixel, pixel, depth};
        return;
    }
    if (button == Button::Left && editing.shows_film() && puller)
    {
        if (const std::optional<Pull> pull = joint_at(pixel))
            gesture = *pull;
        else if (picked)
            gesture = Pull{{}, picked->sample, picked->point};
    }
    if (button != Button::Left || editing.shows_film())
        return;
    const Press press{pixel, with, picked};
    if (const auto point = point_at(pixel))
        take(point->region,
             {{tool == Tool::Rotate ? DragWay::Kind::TurnView : DragWay::Kind::MoveScreen,
               0},
              pixel,
              false,
              {},
              {},
              is_joint(point->region) ? std::nullopt : std::optional(point->point)});
    else if (const auto part = part_at(pixel))
        take(active, {way_of(*part, tool_turns(*active_region())),
                      pixel,
                      false,
                      {},
                      part,
                      active_point});
    else if (tool == Tool::Box)
        start_choice(SelectGesture::Kind::Box, press);
    else if (tool == Tool::Lasso)
        start_choice(SelectGesture::Kind::Lasso, press);
    else if (tool == Tool::Brush)
        start_choice(SelectGesture::Kind::Brush, press);
    else
        gesture = press;
}

void Interaction::State::release(Button button)
{
    if (const Look* const look = current<Look>(); look && look->button == button)
        gesture = {};
    if (button != Button::Left)
        return;
    if (HandleDrag* const handle_drag = current<HandleDrag>();
        handle_drag && !handle_drag->is_by_key)
        let_go();
    else if (current<Pull>())
    {
        gesture = {};
        if (puller)
            puller->let_go();
    }
    else if (const Press* const press = current<Press>())
    {
        const Press clicked = *press;
        gesture = {};
        click(clicked);
    }
    else if (Choice* const choice = current<Choice>())
    {
        choice->is_released = true;
        choice->gesture.collect(editing.shape());
        update_choice();
    }
}

void Interaction::State::begin_pull(const Press& press)
{
    if (tool == Tool::Click)
        return start_choice(SelectGesture::Kind::Box, press);
    const EditedRegion* const region =
        tool == Tool::Draw ? nullptr : region_at(press.picked);
    if (!region)
    {
        gesture = Look{CameraMotion::Orbit, Button::Left, press.pixel, press.pixel, {}};
        return;
    }
    const bool turns = tool_turns(*region);
    const std::string name = region->name;
    gesture = {};
    take(name, {{turns ? DragWay::Kind::TurnFree : DragWay::Kind::MoveScreen, 0},
                press.pixel,
                false,
                press.picked->point});
}

void Interaction::State::follow_pointer()
{
    if (!has_moved)
        return;
    has_moved = false;
    if (const Press* const press = current<Press>();
        press && (pixel - press->pixel).norm() > kClickReach)
        begin_pull(Press(*press));
    if (Look* const look = current<Look>())
    {
        move_camera(camera, look->motion, look->last, pixel, look->start,
                    look->depth_point);
        look->last = pixel;
    }
    else if (Choice* const choice = current<Choice>(); choice && !choice->is_released)
        choice->gesture.move_to(pixel);
    else if (HandleDrag* const handle_drag = current<HandleDrag>())
    {
        handle_drag->drag.move_to(pixel, modifiers.control);
        lead();
    }
    else if (current<PivotDrag>())
        move_pivot();
    else if (const Pull* const pull = current<Pull>(); pull && puller)
    {
        const Eigen::Vector3d place = at_depth(pixel, pull->place);
        if (pull->joint.empty())
            puller->pull(pull->sample, place);
        else
            puller->pull(pull->joint, place);
    }
}

void Interaction::State::find_hover()
{
    hover.reset();
    hot.reset();
    hot_point.reset();
    if (!is_idle() || !is_inside)
        return;
    hot_point = point_at(pixel);
    if (hot_point)
        return;
    hot = part_at(pixel);
    if (hot)
        return;
    if (const auto picked = picker.pick(camera.ray(pixel)))
        hover =
            Hover{picked->sample, picked->point, document().region_of(picked->sample)};
}

void Interaction::State::cancel()
{
    editing.cancel_drag(); // also that of a number field
    if (current<Pull>() && puller)
        puller->let_go();
    gesture = {};
    preview.reset();
    spread.reset();
}

} // namespace cellwarp::core
