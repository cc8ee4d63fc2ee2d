// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <limits>

#include "editor/tools/interaction_state.h"

namespace cellwarp::core
{

namespace
{

/// An arrow key's orbit: 15 degrees [pixel].
constexpr double kOrbitStep = 37.4;

} // namespace

void Interaction::State::key(const KeyEvent& event)
{
    follow_pointer();
    if (event.key == Key::Escape)
    {
        drawn.clear();
        return cancel();
    }
    if (is_idle() && !drawn.empty())
    {
        if (event.key == Key::Backspace || command_of(event) == Command::Undo)
            return drawn.pop_back();
        if (event.key == Key::Enter)
            return attempt(
                [&] { end_drawing(event.modifiers.shift ? Role::Curve : Role::Rod); });
    }
    if (HandleDrag* const handle_drag = current<HandleDrag>())
    {
        if (event.key == Key::Enter || event.key == Key::Space)
            return let_go();
        if (handle_drag->drag.key(event))
        {
            handle_drag->part.reset();
            lead();
        }
        return;
    }
    if (PivotDrag* const held = current<PivotDrag>())
    {
        if (event.key == Key::Enter || event.key == Key::Space)
            return let_pivot_go();
        if (held->drag.key(event))
            snap_pivot();
        return;
    }
    const auto command = command_of(event);
    if (command && !looks(*command))
        finish_selecting();
    // A region may also be in the hand of a number field: no commands meanwhile.
    if (!is_idle() || editing.dragged())
        return;
    if (command && (!editing.shows_film() || looks(*command)))
        attempt([&] { run(*command); });
}

/// A line under way is dropped with its tool.
void Interaction::State::take_tool(Tool next)
{
    if (next != Tool::Draw)
        drawn.clear();
    tool = next;
}

void Interaction::State::run(Command command)
{
    const Selection none(document().selection().num_samples());
    switch (command)
    {
    case Command::Move:
        return take(active,
                    {{DragWay::Kind::MoveScreen, 0}, pixel, true, {}, {}, active_point});
    case Command::Turn:
        return take(active,
                    {{DragWay::Kind::TurnView, 0}, pixel, true, {}, {}, active_point});
    case Command::PlacePivot:
        return take_pivot();
    case Command::PivotToBorder:
        return pivot_to_border();
    case Command::ToolClick:
        return take_tool(Tool::Click);
    case Command::ToolBox:
        return take_tool(Tool::Box);
    case Command::ToolLasso:
        return take_tool(Tool::Lasso);
    case Command::ToolBrush:
        return take_tool(Tool::Brush);
    case Command::ToolMove:
        return take_tool(Tool::Move);
    case Command::ToolRotate:
        return take_tool(Tool::Rotate);
    case Command::ToolDraw:
        return take_tool(Tool::Draw);
    case Command::NextRegion:
        return next_region();
    case Command::SelectAll:
        return document().select(inverted(none), "Select all");
    case Command::SelectNone:
        return document().select(none, "Select nothing");
    case Command::Invert:
        return document().select(inverted(document().selection()), "Invert selection");
    case Command::Grow:
    case Command::Shrink:
    case Command::ExtendConnected:
        spread = Spread{command, {}};
        return;
    case Command::AddConnected:
    case Command::RemoveConnected:
        if (const auto picked = picker.pick(camera.ray(pixel)))
            spread = Spread{command, picked->sample};
        return;
    case Command::ToggleThrough:
        goes_through() = !goes_through();
        return;
    case Command::BrushSmaller:
        brush_radius = std::max(kBrushSmallest, brush_radius / kBrushStep);
        return;
    case Command::BrushLarger:
        brush_radius = std::min(kBrushLargest, brush_radius * kBrushStep);
        return;
    case Command::MakeFixed:
        return make_region(Role::Fixed);
    case Command::MakeHandle:
        return make_region(Role::Handle);
    case Command::MakePin:
        return make_region(Role::Pin);
    case Command::MakeStiff:
        return make_region(Role::Stiff);
    case Command::RemoveRegion:
        return active_point ? remove_point() : remove_region();
    case Command::DrawCentreLine:
        return draw_centre_line();
    case Command::InsertPoint:
        return insert_point();
    case Command::ReleasePoint:
        return release_point({true, true, true});
    case Command::ReleaseDirection:
        return release_point({false, true, true});
    case Command::Undo:
        if (document().can_undo())
            document().undo();
        return;
    case Command::Redo:
        if (document().can_redo())
            document().redo();
        return;
    case Command::FrameSelection:
        return frame(document().selection());
    case Command::FrameAll:
        return frame(none);
    case Command::ViewFront:
        return camera.look_from(Camera::View::Front);
    case Command::ViewBack:
        return camera.look_from(Camera::View::Back);
    case Command::ViewRight:
        return camera.look_from(Camera::View::Right);
    case Command::ViewLeft:
        return camera.look_from(Camera::View::Left);
    case Command::ViewTop:
        return camera.look_from(Camera::View::Top);
    case Command::ViewBottom:
        return camera.look_from(Camera::View::Bottom);
    case Command::TogglePerspective:
        return camera.toggle_perspective();
    case Command::OrbitLeft:
        return camera.orbit({kOrbitStep, 0});
    case Command::OrbitRight:
        return camera.orbit({-kOrbitStep, 0});
    case Command::OrbitUp:
        return camera.orbit({0, kOrbitStep});
    case Command::OrbitDown:
        return camera.orbit({0, -kOrbitStep});
    }
}

void Interaction::State::run_spread(const Neighbours& around)
{
    const Spread what = *std::exchange(spread, std::nullopt);
    const Selection& old = document().selection();
    Selection one(old.num_samples());
    if (what.sample)
        one.add(*what.sample);
    switch (what.command)
    {
    case Command::Grow:
        return document().select(grown(old, around), "Grow selection");
    case Command::Shrink:
        return document().select(shrunk(old, around), "Shrink selection");
    case Command::AddConnected:
        return document().select(combined(old, connected(one, around), SelectMode::Add),
                                 "Add connected");
    case Command::RemoveConnected:
        return document().select(
            combined(old, connected(one, around), SelectMode::Subtract),
            "Subtract connected");
    default:
        return document().select(connected(old, around), "Select connected");
    }
}

void Interaction::State::make_region(Role role)
{
    active = document().add_region(role);
    active_point.reset();
}

void Interaction::State::remove_region()
{
    if (!active_region())
        throw Error(Fault::Usage, "no region is active");
    document().remove_region(std::exchange(active, ""));
}

void Interaction::State::next_region()
{
    const std::vector<EditedRegion>& regions = document().regions();
    std::size_t from = 0;
    while (from < regions.size() && regions[from].name != active)
        ++from;
    for (std::size_t k = 1; k <= regions.size(); ++k)
    {
        const EditedRegion& next = regions[(from + k) % regions.size()];
        if (next.moves())
        {
            active = next.name;
            active_point.reset();
            return;
        }
    }
}

void Interaction::State::frame(const Selection& selection)
{
    const ShownShape& shape = editing.shape();
    Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY), high = -low;
    for (std::size_t place = 0; place < shape.positions.size() / 3; ++place)
    {
        if (!selection.empty() && !selection.holds(shape.layout->order[place]))
            continue;
        const float* const x = shape.positions.data() + 3 * place;
        const Eigen::Vector3d at =
            (shape.to_view * Eigen::Vector4d(x[0], x[1], x[2], 1.0)).head<3>();
        low = low.cwiseMin(at);
        high = high.cwiseMax(at);
    }
    camera.frame(low, high);
}

} // namespace cellwarp::core
