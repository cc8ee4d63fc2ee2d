// SPDX-License-Identifier: GPL-3.0-or-later
// The model, the history, and what is seen of them.
#include <filesystem>
#include <string>

#include <imgui.h>

#include "editor/window/panels.h"
#include "editor/window/style.h"
#include "editor/window/widgets.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

void show_document_panel(EditorApp& app)
{
    if (!section("Model", true))
        return;
    const std::shared_ptr<const GeometryFile> model = app.document().model();
    const Geometry& geometry = model->geometry;
    ImGui::TextUnformatted(
        std::filesystem::path(model->path).filename().string().c_str());
    tip(model->path.c_str());
    std::string counts =
        counted(static_cast<std::int64_t>(geometry.samples.size()), "sample", "samples");
    if (geometry.num_faces() > 0)
        counts += ", " + counted(static_cast<std::int64_t>(geometry.num_faces()), "face",
                                 "faces");
    faint_text(counts);
    const Eigen::Vector3d size = app.document().box().size();
    faint_text("Size " + rounded(size.x()) + " × " + rounded(size.y()) + " × " +
               rounded(size.z()));
    if (!geometry.not_writable.empty())
        warning_text("Cannot be exported: " + geometry.not_writable);
    for (const std::string& warning : app.document().warnings())
        warning_text(warning);
}

void show_history_panel(EditorApp& app, PanelState& state)
{
    if (!section("History", true))
        return;
    const History& history = app.document().history();
    const bool is_busy = !app.takes_edits();
    ImGui::BeginDisabled(is_busy || !app.document().can_undo());
    if (ImGui::Button("Undo"))
        app.undo();
    ImGui::EndDisabled();
    ImGui::SameLine();
    ImGui::BeginDisabled(is_busy || !app.document().can_redo());
    if (ImGui::Button("Redo"))
        app.redo();
    ImGui::EndDisabled();
    ImGui::SameLine();
    ImGui::AlignTextToFramePadding();
    faint_text(counted(static_cast<std::int64_t>(history.position())) + " of " +
               counted(static_cast<std::int64_t>(history.size()), "edit", "edits"));
    ImGui::PushStyleColor(ImGuiCol_ChildBg, palette().bar);
    ImGui::BeginChild("edits", {0, ImGui::GetTextLineHeightWithSpacing() * 7.5f}, false,
                      ImGuiWindowFlags_NavFlattened);
    ImGui::Indent(letters(0.6f));
    std::optional<std::size_t> wanted;
    ImGuiListClipper clipper;
    clipper.Begin(static_cast<int>(history.size()) + 1);
    while (clipper.Step())
        for (int row = clipper.DisplayStart; row < clipper.DisplayEnd; ++row)
        {
            const auto position = idx(row);
            const std::string name = (row == 0 ? "Opened" : history.name(position - 1)) +
                                     "##" + std::to_string(row);
            const bool is_undone = position > history.position();
            if (is_undone)
                ImGui::PushStyleColor(ImGuiCol_Text, palette().faint);
            if (ImGui::Selectable(name.c_str(), position == history.position()))
                wanted = position;
            if (is_undone)
                ImGui::PopStyleColor();
        }
    clipper.End();
    if (state.history_position != history.position())
    {
        state.history_position = history.position();
        const float row = ImGui::GetTextLineHeightWithSpacing();
        ImGui::SetScrollY(static_cast<float>(history.position()) * row - 3.5f * row);
    }
    ImGui::EndChild();
    ImGui::PopStyleColor();
    if (wanted && !is_busy)
        app.attempt(Place::Window, [&] { app.document().go_to(*wanted); });
}

void show_view_panel(EditorApp& app)
{
    if (!section("View", false))
        return;
    ViewOptions& view = app.view;
    Interaction& hand = app.opened()->hand;
    const float column = ImGui::GetContentRegionAvail().x / 2;
    const auto pair =
        [&](const char* left, bool& is_left, const char* right, bool& is_right)
    {
        ImGui::Checkbox(left, &is_left);
        ImGui::SameLine(column);
        ImGui::Checkbox(right, &is_right);
    };
    pair("Faces", view.shows_faces, "Edges", view.shows_edges);
    pair("Region colours", view.shows_regions, "Rest shape", view.shows_ghost);
    pair("Floor", view.shows_floor, "Dark", view.is_dark);
    label("Cells");
    int cells = static_cast<int>(view.cells);
    ImGui::SetNextItemWidth(-1);
    if (ImGui::Combo("##cells", &cells, "Hidden\0Wire\0Glass\0"))
        view.cells = static_cast<CellsShown>(cells);
    label("Coloured by");
    int by = static_cast<int>(view.cell_colours);
    ImGui::SetNextItemWidth(-1);
    if (ImGui::Combo("##by", &by, "Gap to neighbours\0Depth\0Region\0"))
        view.cell_colours = static_cast<CellColours>(by);
    label("Mouse like");
    int navigation = static_cast<int>(hand.navigation());
    ImGui::SetNextItemWidth(-1);
    if (ImGui::Combo("##navigation", &navigation, "Blender\0Maya\0"))
        hand.set_navigation(static_cast<Navigation>(navigation));
    label("Turns like");
    int turning = static_cast<int>(hand.camera().turning());
    ImGui::SetNextItemWidth(-1);
    if (ImGui::Combo("##turning", &turning, "a turntable\0a trackball\0"))
        hand.set_turning(static_cast<Camera::Turning>(turning));
    tip("A turntable keeps the axis below upright; a trackball lets any side be up");
    label("Up");
    int up = hand.camera().up_axis();
    ImGui::SetNextItemWidth(-1);
    if (ImGui::Combo("##up", &up, "x\0y\0z\0"))
        hand.set_up_axis(up);
}

} // namespace cellwarp::core
