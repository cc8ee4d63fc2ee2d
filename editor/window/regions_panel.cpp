// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include "editor/window/panels.h"
#include "editor/window/style.h"
#include "editor/window/warning_words.h"
#include "editor/window/widgets.h"

namespace cellwarp::core
{

namespace
{

/// A number field as wide as there is room. \p typed: what stands in it while it is
/// typed. \return the number when it is done
std::optional<double> typed_number(const char* id, const char* format, double value,
                                   std::optional<double>& typed, const char* hint)
{
    value = typed.value_or(value);
    ImGui::SetNextItemWidth(-1);
    if (ImGui::InputDouble(id, &value, 0.0, 0.0, format))
        typed = value;
    tip(hint);
    if (!ImGui::IsItemDeactivatedAfterEdit())
        return std::nullopt;
    typed.reset();
    return value;
}

struct RoleName
{
    Role role;
    const char* name;
    const char* tip;
};

constexpr std::array<RoleName, 4> kRoles = {
    {{Role::Fixed, "Fixed", "Stays where it is"},
     {Role::Handle, "Handle", "Is moved and turned by you"},
     {Role::Pin, "Pin", "Is moved by you and turns as it likes"},
     {Role::Stiff, "Stiff", "Bends less than the rest"}}};

const char* name_of(Role role)
{
    for (const RoleName& known : kRoles)
        if (known.role == role)
            return known.name;
    return role == Role::Rod ? "Rod" : role == Role::Bone ? "Joint" : "Curve";
}

void show_makers(EditorApp& app)
{
    const std::size_t count = app.document().selection().count();
    if (count == 0)
        faint_text("Select samples in the view, then make a region of them.");
    else
        faint_text("Make the " + counted(static_cast<std::int64_t>(count),
                                         "selected sample:", "selected samples:"));
    ImGui::BeginDisabled(count == 0);
    // Four in a row; in a narrow panel two.
    const float gap = ImGui::GetStyle().ItemSpacing.x;
    const float room = ImGui::GetContentRegionAvail().x;
    const std::size_t columns = room < letters(30) ? 2 : kRoles.size();
    const float width = (room + gap) / static_cast<float>(columns) - gap;
    for (std::size_t k = 0; k < kRoles.size(); ++k)
    {
        const RoleName& known = kRoles[k];
        ImVec4 colour = shown(colour_of(known.role));
        colour.w = 0.30f;
        ImGui::PushStyleColor(ImGuiCol_Button, colour);
        colour.w = 0.50f;
        ImGui::PushStyleColor(ImGuiCol_ButtonHovered, colour);
        colour.w = 0.70f;
        ImGui::PushStyleColor(ImGuiCol_ButtonActive, colour);
        if (ImGui::Button(known.name, {width, 0}))
            app.attempt(Place::Regions,
                        [&]
                        {
                            const std::string name =
                                app.document().add_region(known.role);
                            app.opened()->hand.set_active_region(name);
                        });
        ImGui::PopStyleColor(3);
        tip(known.tip);
        if ((k + 1) % columns != 0)
            ImGui::SameLine();
    }
    ImGui::EndDisabled();
}

void show_row(EditorApp& app, const EditedRegion& region, const std::string& failed)
{
    Interaction& hand = app.opened()->hand;
    ImGui::PushID(region.name.c_str());
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    const ImVec2 corner = ImGui::GetCursorScreenPos();
    const float height = ImGui::GetTextLineHeight();
    if (ImGui::Selectable("##row", hand.active_region() == region.name,
                          ImGuiSelectableFlags_SpanAllColumns))
        hand.set_active_region(region.name);
    ImGui::GetWindowDrawList()->AddCircleFilled(
        {corner.x + 0.6f * height, corner.y + 0.5f * height}, 0.34f * height,
        packed(shown(colour_of(region.role))), 24);
    ImGui::TableNextColumn();
    if (failed == region.name)
        ImGui::TextColored(palette().error, "%s  !", region.name.c_str());
    else
        ImGui::TextUnformatted(region.name.c_str());
    if (ImGui::TableNextColumn())
        ImGui::TextColored(palette().faint, "%s", name_of(region.role));
    ImGui::TableNextColumn();
    const std::string count = counted(static_cast<std::int64_t>(region.samples.size()));
    const float room = ImGui::GetContentRegionAvail().x;
    ImGui::SetCursorPosX(ImGui::GetCursorPosX() +
                         std::max(0.0f, room - ImGui::CalcTextSize(count.c_str()).x));
    ImGui::TextUnformatted(count.c_str());
    ImGui::PopID();
}

void show_list(EditorApp& app)
{
    const std::vector<EditedRegion>& regions = app.document().regions();
    if (regions.empty())
        return;
    const SolveStatus status = app.opened()->editing.status();
    const std::string failed =
        status.state == SolveStatus::State::Failed ? status.error_region : "";
    // In a narrow panel the colour alone shows the role.
    const bool is_narrow = ImGui::GetContentRegionAvail().x < letters(30);
    if (ImGui::BeginTable("regions", 4, ImGuiTableFlags_NoPadOuterX))
    {
        ImGui::TableSetupColumn("", ImGuiTableColumnFlags_WidthFixed, letters(1.9f));
        ImGui::TableSetupColumn("", ImGuiTableColumnFlags_WidthStretch);
        ImGui::TableSetupColumn("",
                                ImGuiTableColumnFlags_WidthFixed |
                                    (is_narrow ? ImGuiTableColumnFlags_Disabled : 0),
                                letters(5.5f));
        ImGui::TableSetupColumn("", ImGuiTableColumnFlags_WidthFixed, letters(7.5f));
        for (const EditedRegion& region : regions)
            show_row(app, region, failed);
        ImGui::EndTable();
    }
    if (!failed.empty())
        error_text(in_window_words(status.error, app.document()));
}

void show_name(EditorApp& app, PanelState& state, const EditedRegion& region)
{
    label("Name");
    if (state.renamed != region.name)
    {
        state.renamed = region.name;
        state.name = region.name;
    }
    ImGui::SetNextItemWidth(-1);
    ImGui::InputText("##name", &state.name);
    if (!ImGui::IsItemDeactivatedAfterEdit())
        return;
    const std::string old = region.name, name = state.name;
    state.renamed.clear();
    app.attempt(Place::Regions,
                [&]
                {
                    app.document().rename_region(old, name);
                    app.opened()->hand.set_active_region(name);
                });
}

void show_role(EditorApp& app, PanelState& state, const EditedRegion& region)
{
    label("Role");
    if (region.is_spline())
    {
        ImGui::TextUnformatted(name_of(region.role));
        tip("Told by its points: drag them in the view");
        return;
    }
    ImGui::SetNextItemWidth(region.role == Role::Stiff ? letters(9.0f) : -1);
    if (ImGui::BeginCombo("##role", name_of(region.role)))
    {
        for (const RoleName& known : kRoles)
            if (ImGui::Selectable(known.name, known.role == region.role) &&
                known.role != region.role)
            {
                // A stiff region of factor 1 would be as soft as the rest; new ones
                // get as much.
                const double factor = known.role == Role::Stiff ? kUsualStiffness : 1.0;
                const std::string name = region.name;
                app.attempt(Place::Regions,
                            [&] { app.document().set_role(name, known.role, factor); });
                ImGui::EndCombo();
                return;
            }
        ImGui::EndCombo();
    }
    if (region.role != Role::Stiff)
        return;
    ImGui::SameLine();
    const std::optional<double> factor =
        typed_number("##factor", "× %.4g", region.factor, state.factor,
                     "How many times as stiff as "
                     "the rest");
    const std::string name = region.name;
    if (factor)
        app.attempt(Place::Regions,
                    [&] { app.document().set_role(name, Role::Stiff, *factor); });
}

/// What holds a point, each of it to be let go.
void show_holds(EditorApp& app, const EditedRegion& region, std::size_t point)
{
    const EditedPoint& of = region.points[point];
    faint_text(fmt::format(
        "Point {}{}{}", point,
        of.parts.place ? fmt::format(" at {:.4g}, {:.4g}, {:.4g} of the rest",
                                     of.place.x(), of.place.y(), of.place.z())
                       : std::string(" finds its place"),
        of.parts.twist ? fmt::format(", turned by {:.4g}°", of.degrees) : std::string()));
    if (region.role != Role::Rod)
        return;
    label("Held");
    const auto held = [&](const char* name, bool is_held, HoldParts parts)
    {
        ImGui::BeginDisabled(!is_held);
        if (toggle(name, is_held))
            app.attempt(Place::Regions,
                        [&] { app.document().release_point(region.name, point, parts); });
        ImGui::EndDisabled();
        tip("Click to let it go; moving or turning the point holds it");
    };
    held("place", of.parts.place, {true, false, false});
    ImGui::SameLine(0, letters(0.3f));
    held("direction", of.parts.tangent, {false, true, false});
    ImGui::SameLine(0, letters(0.3f));
    held("twist", of.parts.twist, {false, false, true});
}

/// The tube that a rod carries, and whether it pushes back.
void show_tube(EditorApp& app, PanelState& state, const EditedRegion& region)
{
    RodShape shape = shape_of(region);
    label("Radius");
    const std::optional<double> radius = typed_number(
        "##radius", "%.4g",
        shape.radius.value_or(region.frame.length_to_model(region.spline->radius())),
        state.radius, "Of the tube whose cells it carries [model unit]");
    if (radius)
        shape.radius = *radius > 0 && *radius < 10 * app.document().box().size().norm()
                           ? radius
                           : std::nullopt;
    label("Stiffness");
    const std::optional<double> stiffness = typed_number(
        "##stiffness", "%.4g", shape.stiffness.value_or(0.0), state.stiffness,
        "With which it pushes back on the cells; 0: it leads them");
    if (stiffness)
        shape.stiffness =
            *stiffness > 0 && std::isfinite(*stiffness) ? stiffness : std::nullopt;
    if (radius || stiffness)
        app.attempt(Place::Regions, [&] { app.document().set_line(region.name, shape); });
}

/// Points of a rod or curve: where they are held, and the one that keys act on.
void show_points(EditorApp& app, PanelState& state, const EditedRegion& region)
{
    Interaction& hand = app.opened()->hand;
    if (region.role == Role::Rod)
        show_tube(app, state, region);
    label("Points");
    for (std::size_t k = 0; k < region.points.size(); ++k)
    {
        const EditedPoint& point = region.points[k];
        ImGui::PushID(static_cast<int>(k));
        if (k > 0 && ImGui::GetContentRegionAvail().x > letters(4))
            ImGui::SameLine(0, letters(0.3f));
        const std::string name =
            point.parts.place ? std::to_string(k) : fmt::format("({})", k);
        if (toggle(name.c_str(), hand.active_point() == k))
            hand.set_active_point(hand.active_point() == k ? std::nullopt
                                                           : std::optional(k));
        tip(point.parts.place ? "Held" : "Finds its place by itself");
        ImGui::PopID();
    }
    const std::optional<std::size_t> active = hand.active_point();
    if (!active || *active >= region.points.size())
        return;
    show_holds(app, region, *active);
    if (ImGui::Button("Insert"))
        hand.run(Command::InsertPoint);
    tip("A point behind it (Shift+N)");
    ImGui::SameLine();
    if (ImGui::Button("Remove point"))
        hand.run(Command::RemoveRegion);
}

/// The curve or rod that a pin stays on.
void show_guide(EditorApp& app, PanelState& state, const EditedRegion& region)
{
    label("Stays on");
    ImGui::SetNextItemWidth(-1);
    const std::string none = "nothing: you move it";
    if (ImGui::BeginCombo("##guide",
                          region.guide.empty() ? none.c_str() : region.guide.c_str()))
    {
        std::vector<std::string> names = {""};
        for (const EditedRegion& other : app.document().regions())
            if (other.is_spline())
                names.push_back(other.name);
        for (const std::string& name : names)
            if (ImGui::Selectable(name.empty() ? none.c_str() : name.c_str(),
                                  name == region.guide) &&
                name != region.guide)
            {
                app.attempt(Place::Regions, [&]
                            { app.document().put_on(region.name, name, region.share); });
                break;
            }
        ImGui::EndCombo();
    }
    if (region.guide.empty())
        return;
    bool slides = !region.share;
    if (ImGui::Checkbox("slides along it", &slides))
        app.attempt(Place::Regions,
                    [&]
                    {
                        app.document().put_on(region.name, region.guide,
                                              slides ? std::nullopt : std::optional(0.5));
                    });
    if (!region.share)
        return;
    label("At");
    if (const std::optional<double> share =
            typed_number("##share", "%.4g", *region.share, state.share,
                         "A share of its length, from 0 to 1"))
        app.attempt(Place::Regions,
                    [&] { app.document().put_on(region.name, region.guide, share); });
}

/// Number fields of the placement. \return whether one is in the hand
bool show_numbers(EditorApp& app, const EditedRegion& region, RigidMove& value,
                  bool& changed)
{
    const double diagonal = app.document().box().size().norm();
    const auto speed = static_cast<float>(diagonal * 1e-3);
    bool is_held = false;
    label("Move");
    ImGui::SetNextItemWidth(-1);
    changed |=
        ImGui::DragScalarN("##move", ImGuiDataType_Double, value.translation.data(), 3,
                           speed, nullptr, nullptr, "%.4g");
    is_held |= ImGui::IsItemActive();
    tip("Along x, y and z [model unit]. Drag, or double-click to type");
    if (region.role == Role::Pin)
        return is_held;
    label("Turn");
    ImGui::SetNextItemWidth(-1);
    changed |= ImGui::DragScalar("##turn", ImGuiDataType_Double, &value.degrees, 0.25f,
                                 nullptr, nullptr, "%.4g°");
    is_held |= ImGui::IsItemActive();
    tip("About the axis below, through the pivot");
    label("Axis");
    ImGui::SetNextItemWidth(-1);
    Eigen::Vector3d axis = value.axis;
    if (ImGui::DragScalarN("##axis", ImGuiDataType_Double, axis.data(), 3, 0.01f, nullptr,
                           nullptr, "%.3g") &&
        axis.norm() > 1e-6)
    {
        value.axis = axis.normalized();
        changed = true;
    }
    is_held |= ImGui::IsItemActive();
    return is_held;
}

/// What the region turns about.
void show_pivot(EditorApp& app, const EditedRegion& region)
{
    Interaction& hand = app.opened()->hand;
    std::optional<Eigen::Vector3d> pivot = hand.pivot();
    if (!pivot)
        return;
    label("Pivot");
    ImGui::SetNextItemWidth(-1);
    const auto speed = static_cast<float>(app.document().box().size().norm() * 1e-3);
    if (ImGui::DragScalarN("##pivot", ImGuiDataType_Double, pivot->data(), 3, speed,
                           nullptr, nullptr, "%.4g"))
        hand.set_pivot(pivot);
    tip("What it turns about, where the model is at rest [model unit]. V in the view "
        "puts it elsewhere");
    label("");
    ImGui::BeginDisabled(!region.border);
    if (ImGui::Button("To its border"))
        hand.run(Command::PivotToBorder);
    tip("The middle of where it hangs together with the rest (Shift+V)");
    ImGui::EndDisabled();
    ImGui::SameLine();
    if (ImGui::Button("To its middle"))
        hand.set_pivot(std::nullopt);
}

void show_placement(EditorApp& app, PanelState& state, const EditedRegion& region)
{
    Editing& editing = app.opened()->editing;
    PlacementEntry& entry = state.placement;
    const std::string name = region.name;
    if (!entry.is_held)
        entry.value =
            editing.dragged() == name
                ? editing.dragged_placement().value_or(region.placement)
                : about(app.opened()->hand.pivot().value_or(region.pivot()), region);
    bool changed = false;
    // While the hand in the view is at work, numbers only show.
    ImGui::BeginDisabled(app.opened()->hand.is_busy() && !entry.is_held);
    const bool is_active = show_numbers(app, region, entry.value, changed);
    ImGui::EndDisabled();
    entry.is_over = entry.is_over && is_active;
    changed = changed && !entry.is_over;
    if (changed && !entry.is_held)
    {
        std::string why;
        entry.is_held = editing.begin_drag(name, &why);
        entry.region = name;
        if (!entry.is_held)
            app.say(Place::Regions, why, true);
    }
    if (changed && entry.is_held)
        editing.drag_to(entry.value);
    if (!is_active && entry.is_held)
    {
        entry.is_held = false;
        app.attempt(Place::Regions, [&] { editing.end_drag(); });
    }
}

/// A drag by the fields ends with its region, and where another one is active.
void end_stray_entry(EditorApp& app, PlacementEntry& entry)
{
    if (!entry.is_held)
        return;
    Editing& editing = app.opened()->editing;
    if (editing.dragged() != entry.region)
    {
        entry.is_held = false;
        entry.is_over = true;
        return;
    }
    const EditedRegion* region = app.document().region(entry.region);
    const bool can_move = region != nullptr && region->moves();
    if (can_move && app.opened()->hand.active_region() == entry.region)
        return;
    entry.is_held = false;
    if (can_move)
        app.attempt(Place::Regions, [&] { editing.end_drag(); });
    else
        editing.cancel_drag();
}

void show_active(EditorApp& app, PanelState& state)
{
    const EditedRegion* found = app.document().region(app.opened()->hand.active_region());
    if (found == nullptr)
        return;
    // A copy: commands below change what it points to.
    const EditedRegion region = *found;
    ImGui::Dummy({0, letters(0.2f)});
    ImGui::Separator();
    ImGui::Dummy({0, letters(0.1f)});
    ImGui::BeginDisabled(app.opened()->hand.is_busy());
    if (region.joint)
        faint_text(region.name + (region.joint->is_root   ? ": the root of the skeleton"
                                  : region.joint->is_held ? ": held at its place"
                                                          : ": a joint"));
    if (region.joint && region.joint->is_held && ImGui::Button("Let go"))
        app.attempt(Place::Regions, [&] { app.document().release_joint(region.name); });
    if (!region.joint)
    {
        show_name(app, state, region);
        show_role(app, state, region);
    }
    if (region.is_spline())
        show_points(app, state, region);
    if (region.role == Role::Pin)
        show_guide(app, state, region);
    ImGui::EndDisabled();
    if (region.moves())
        show_placement(app, state, region);
    ImGui::BeginDisabled(app.opened()->hand.is_busy());
    show_pivot(app, region);
    if (region.moves() && ImGui::Button("Back to rest"))
        app.attempt(Place::Regions,
                    [&] { app.document().move_region(region.name, RigidMove()); });
    if (region.moves())
        ImGui::SameLine();
    ImGui::BeginDisabled(app.document().selection().empty() || region.is_spline() ||
                         region.joint);
    if (ImGui::Button("Use selection"))
        app.attempt(Place::Regions, [&] { app.document().set_samples(region.name); });
    tip("The region becomes what is selected");
    ImGui::EndDisabled();
    ImGui::SameLine();
    ImGui::BeginDisabled(region.joint.has_value());
    if (ImGui::Button("Remove"))
        app.attempt(Place::Regions, [&] { app.document().remove_region(region.name); });
    ImGui::EndDisabled();
    ImGui::EndDisabled();
}

} // namespace

void show_regions_panel(EditorApp& app, PanelState& state)
{
    end_stray_entry(app, state.placement);
    if (!section("Regions", true))
        return;
    // A click here ends the typing of a number first: it must not be lost for that.
    const bool is_dragging = app.opened()->hand.is_busy() && !state.placement.is_held;
    ImGui::BeginDisabled(is_dragging);
    show_makers(app);
    show_list(app);
    ImGui::EndDisabled();
    if (const Notice* notice = app.notice(Place::Regions))
        notice->is_error ? error_text(notice->text) : faint_text(notice->text);
    show_active(app, state);
}

} // namespace cellwarp::core
