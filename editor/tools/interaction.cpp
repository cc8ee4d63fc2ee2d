// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/interaction.h"

#include <algorithm>
#include <cmath>
#include <new>

#include <fmt/format.h>

#include "editor/tools/hints.h"
#include "editor/tools/interaction_state.h"

namespace cellwarp::core
{

Interaction::Interaction(Editing& editing) : state_(std::make_unique<State>(editing)) {}
Interaction::~Interaction() = default;

void Interaction::resize(double width, double height)
{
    state_->camera.resize(width, height);
}

void Interaction::pointer_moved(const Eigen::Vector2d& pixel, const Modifiers& modifiers)
{
    State& s = *state_;
    if (!pixel.allFinite())
        return;
    s.pixel = pixel;
    s.modifiers = modifiers;
    s.is_inside = s.has_moved = true;
    if (State::Choice* const choice = s.current<State::Choice>();
        choice && !choice->is_released)
        choice->gesture.move_to(pixel);
}

void Interaction::button(Button button, bool is_pressed, const Modifiers& modifiers)
{
    State& s = *state_;
    s.follow_pointer();
    s.modifiers = modifiers;
    if (is_pressed)
        s.press(button, modifiers);
    else
        s.release(button);
}

void Interaction::wheel(const Eigen::Vector2d& steps, const Modifiers& modifiers)
{
    State& s = *state_;
    if (State::HandleDrag* const drag = s.current<State::HandleDrag>();
        drag && drag->point && steps.allFinite() && s.active_region()->role == Role::Rod)
    {
        drag->point->wheel += State::kTwistStep * steps.y();
        s.lead();
    }
    if (!steps.allFinite() || s.current<State::HandleDrag>() ||
        s.current<State::PivotDrag>() || s.current<State::Choice>())
        return;
    s.follow_pointer();
    if (s.tool == Tool::Brush && !modifiers.control)
        return set_brush_radius(s.brush_radius * std::pow(State::kBrushStep, steps.y()));
    const auto picked = s.picker.pick(s.camera.ray(s.pixel));
    s.camera.zoom(steps.y(), s.pixel,
                  picked ? std::optional(picked->point) : std::nullopt);
}

void Interaction::key(const KeyEvent& event)
{
    state_->key(event);
}

void Interaction::focus_lost()
{
    state_->cancel();
    state_->is_inside = false;
}

void Interaction::State::update_picker(bool waits)
{
    const auto attempt = [&](auto&& what)
    {
        try
        {
            what();
        }
        catch (const std::bad_alloc&)
        {
            complain("out of memory: nothing can be picked");
        }
    };
    if (waits)
        attempt([&] { picker.wait(); });
    attempt([&] { picker.update(editing.shape()); });
    if (waits)
        attempt([&] { picker.wait(); });
}

void Interaction::update()
{
    State& s = *state_;
    if (!s.has_framed && s.camera.width() >= 1 && s.camera.height() >= 1 &&
        !s.editing.shape().positions.empty())
    {
        s.frame(Selection());
        s.has_framed = true;
    }
    // Somebody else may have ended the drag, or removed the region.
    if (s.current<State::HandleDrag>() && !s.editing.dragged())
        s.gesture = {};
    const EditedRegion* const region = s.active_region();
    if (!region)
        s.active.clear();
    if (s.current<State::PivotDrag>() && (!region || !State::has_pivot(*region)))
        s.gesture = {};
    if (!region || region->points.empty())
        s.active_point.reset();
    else if (s.active_point) // undo may have taken it
        s.active_point = std::min(*s.active_point, region->points.size() - 1);
    if (const std::optional<DrawnLine> drawn = s.editing.take_drawn())
    {
        if (!drawn->error.empty())
            s.complain(drawn->error);
        else
        {
            s.active = drawn->name;
            s.active_point.reset();
        }
    }
    s.follow_pointer();
    if (!s.current<State::HandleDrag>()) // nothing is picked meanwhile
        s.update_picker(false);
    s.update_choice();
    if (s.spread && !s.editing.dragged())
        if (const Neighbours* const around = s.neighbours.get())
            s.attempt([&] { s.run_spread(*around); });
    s.find_hover();
    if (Clock::now() > s.complaint_ends)
        s.complaint.clear();
}

void Interaction::wait()
{
    State& s = *state_;
    s.update_picker(true);
    while ((s.spread && !s.editing.dragged()) ||
           (s.current<State::Choice>() && s.current<State::Choice>()->is_released))
    {
        s.neighbours.wait();
        update();
    }
}

Tool Interaction::tool() const
{
    return state_->tool;
}

void Interaction::set_tool(Tool tool)
{
    state_->cancel();
    state_->take_tool(tool);
}

Navigation Interaction::navigation() const
{
    return state_->navigation;
}

void Interaction::set_up_axis(int axis)
{
    state_->camera.set_up_axis(axis);
}

void Interaction::set_turning(Camera::Turning turning)
{
    state_->camera.set_turning(turning);
}

void Interaction::look_as(const std::string& view)
{
    state_->has_framed |= state_->camera.look_as(view);
}

void Interaction::set_navigation(Navigation navigation)
{
    state_->navigation = navigation;
}

bool Interaction::selects_through() const
{
    return state_->goes_through();
}

void Interaction::set_selects_through(bool through)
{
    state_->goes_through() = through;
}

double Interaction::brush_radius() const
{
    return state_->brush_radius;
}

void Interaction::set_brush_radius(double pixels)
{
    if (std::isfinite(pixels))
        state_->brush_radius = std::clamp(pixels, kBrushSmallest, kBrushLargest);
}

const std::string& Interaction::active_region() const
{
    return state_->active;
}

void Interaction::set_active_region(const std::string& region)
{
    if (region == state_->active)
        return;
    state_->cancel();
    state_->active = region;
    state_->active_point.reset();
}

std::optional<std::size_t> Interaction::active_point() const
{
    return state_->active_point;
}

void Interaction::set_active_point(std::optional<std::size_t> point)
{
    state_->active_point = point;
}

void Interaction::run(Command command)
{
    if (!is_busy())
        state_->attempt([&] { state_->run(command); });
}

void Interaction::frame_selection()
{
    state_->frame(state_->document().selection());
}

const Camera& Interaction::camera() const
{
    return state_->camera;
}

std::vector<GizmoPart> Interaction::gizmo() const
{
    return state_->gizmo();
}

std::vector<Eigen::Vector2d> Interaction::outline() const
{
    const State& s = *state_;
    if (const State::Choice* const choice = s.current<State::Choice>();
        choice && !choice->is_released)
        return choice->gesture.outline();
    if (s.tool != Tool::Brush || !s.is_inside || is_busy())
        return {};
    const SelectGesture brush({SelectGesture::Kind::Brush, true, s.brush_radius},
                              s.camera, ShownShape{}, s.pixel);
    return brush.outline();
}

void Interaction::set_puller(FleshPuller* puller)
{
    state_->puller = puller;
    if (state_->current<State::Pull>())
        state_->gesture = {};
}

std::optional<Hover> Interaction::hover() const
{
    return state_->hover;
}

std::vector<SeenLine> Interaction::lines() const
{
    const State& s = *state_;
    std::vector<SeenLine> lines;
    for (const ShownLine& line : s.editing.shape().lines)
    {
        const EditedRegion* const region = s.document().region(line.name);
        const bool is_known = region && (region->is_spline() || region->joint);
        if (!is_known && !s.editing.shows_film())
            continue; // it is gone, and the shape without it not there yet
        SeenLine& seen = lines.emplace_back();
        seen.places = line.places;
        seen.is_rod = line.is_rod;
        seen.is_bone = line.is_bone;
        seen.is_active = line.name == s.active;
        for (std::size_t k = 0; k < line.points.size(); ++k)
            seen.points.push_back(
                {line.points[k],
                 is_known && (region->joint ? region->joint->is_held
                                            : k < region->points.size() &&
                                                  region->points[k].parts.place),
                 seen.is_active && (line.is_bone || s.active_point == k),
                 s.hot_point && s.hot_point->region == line.name &&
                     s.hot_point->point == k});
    }
    return lines;
}

const std::vector<Eigen::Vector3d>& Interaction::drawn() const
{
    return state_->drawn;
}

const Selection& Interaction::shown_selection() const
{
    return state_->preview ? *state_->preview : state_->document().selection();
}

std::string Interaction::status() const
{
    const State& s = *state_;
    if (const State::HandleDrag* const handle_drag = s.current<State::HandleDrag>())
        return handle_drag->drag.status() +
               (handle_drag->point && handle_drag->point->wheel != 0.0
                    ? fmt::format(", twist {:.4g}°", handle_drag->point->wheel)
                    : "") +
               (handle_drag->is_by_key ? " (Enter or click: done, Esc: back)"
                                       : " (let go: done, Esc: back)");
    if (s.current<State::PivotDrag>())
        return s.pivot_status();
    if (const State::Choice* const choice = s.current<State::Choice>())
        return choice->name() + (choice->is_released ? " ..." : " (Esc: back)");
    if (const State::Pull* const pull = s.current<State::Pull>())
        return pull->joint.empty() ? "Pull the flesh (let go: it swings back)"
                                   : "Pull " + pull->joint + " (let go: it stays)";
    if (const State::Look* const look = s.current<State::Look>())
        return look->motion == CameraMotion::Orbit ? "Orbit"
               : look->motion == CameraMotion::Pan ? "Pan"
                                                   : "Zoom";
    if (!s.drawn.empty())
        return fmt::format(
            "{} point{} (click: next, Backspace: one less, Enter: rod, Shift+Enter: "
            "curve, Esc: back)",
            s.drawn.size(), s.drawn.size() == 1 ? "" : "s");
    if (s.tool == Tool::Draw)
        return "Click along the middle of a limb";
    if (s.editing.is_drawing())
        return "Finding the centre line ...";
    return s.spread ? "Finding what lies next to each other ..." : "";
}

std::string Interaction::hint() const
{
    const State& s = *state_;
    std::string next = next_step(
        s.document(), {s.current<State::HandleDrag>() != nullptr, s.num_drags, s.tool});
    if (s.num_left_out == 0 || s.left_out_at != s.document().revision())
        return next;
    return fmt::format("{} hidden behind {} left out (Alt+Z: take what is hidden, too)",
                       s.num_left_out, s.num_left_out == 1 ? "it was" : "them were") +
           (next.empty() ? "" : ". " + next);
}

std::string Interaction::complaint() const
{
    return state_->complaint;
}

bool Interaction::is_busy() const
{
    return !state_->is_idle() || state_->editing.dragged() ||
           state_->editing.shows_film();
}

} // namespace cellwarp::core
