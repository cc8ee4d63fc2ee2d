// SPDX-License-Identifier: GPL-3.0-or-later
// Menu bar, column of tools, bar of options and status bar.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <imgui.h>

#include "editor/window/panels.h"
#include "editor/window/style.h"
#include "editor/window/widgets.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

struct ToolName
{
    Tool tool;
    const char* name;
    const char* tip;
};

constexpr std::array<ToolName, kNumTools> kTools = {
    {{Tool::Click, "Click",
      "Select the sample under the pointer; drag for a rectangle (1)"},
     {Tool::Box, "Box", "Select what lies in a rectangle (2, B)"},
     {Tool::Lasso, "Lasso", "Select what lies in a drawn outline (3)"},
     {Tool::Brush, "Brush", "Paint over what is to be selected (4, C)"},
     {Tool::Move, "Move", "Move the active region (5, G)"},
     {Tool::Rotate, "Rotate", "Turn the active region, or twist a point of a rod (6, R)"},
     {Tool::Draw, "Rod", "Draw a rod through the shape, click by click (7, D)"}}};

void draw_arrow(ImDrawList& list, ImVec2 from, ImVec2 to, float width, ImU32 ink)
{
    list.AddLine(from, to, ink, width);
    const float x = to.x - from.x, y = to.y - from.y, length = std::hypot(x, y);
    const float head = 2.4f * width, dx = x / length * head, dy = y / length * head;
    list.AddTriangleFilled({to.x + 0.6f * dx, to.y + 0.6f * dy},
                           {to.x - dx * 0.6f - dy, to.y - dy * 0.6f + dx},
                           {to.x - dx * 0.6f + dy, to.y - dy * 0.6f - dx}, ink);
}

/// A tool's picture in a square of side 2 \p r about \p c.
void draw_icon(ImDrawList& list, Tool tool, ImVec2 c, float r, ImU32 ink)
{
    const float width = std::max(1.0f, 0.17f * r);
    constexpr auto kPi = std::numbers::pi_v<float>;
    const auto at = [&](float x, float y) { return ImVec2(c.x + x * r, c.y + y * r); };
    switch (tool)
    {
    case Tool::Click:
    {
        const std::array<ImVec2, 7> outline = {
            at(-0.5f, -0.9f), at(-0.5f, 0.62f), at(-0.12f, 0.3f), at(0.14f, 0.9f),
            at(0.42f, 0.78f), at(0.16f, 0.2f),  at(0.62f, 0.14f)};
        list.AddPolyline(outline.data(), static_cast<int>(outline.size()), ink,
                         ImDrawFlags_Closed, width);
        break;
    }
    case Tool::Box:
        for (int k = 0; k < 4; ++k) // dashes
            for (const float side : {-0.78f, 0.78f})
            {
                const float a = -0.78f + 0.45f * static_cast<float>(k), b = a + 0.24f;
                list.AddLine(at(a, side), at(b, side), ink, width);
                list.AddLine(at(side, a), at(side, b), ink, width);
            }
        break;
    case Tool::Lasso:
        list.PathArcTo(at(0.0f, -0.15f), 0.74f * r, 0.75f * kPi, 2.6f * kPi, 24);
        list.PathLineTo(at(-0.35f, 0.9f));
        list.PathStroke(ink, 0, width);
        break;
    case Tool::Brush:
        list.AddCircle(c, 0.8f * r, ink, 24, width);
        list.AddCircleFilled(c, 0.26f * r, ink, 12);
        break;
    case Tool::Move:
        for (const ImVec2 to : {at(0.78f, 0), at(-0.78f, 0), at(0, 0.78f), at(0, -0.78f)})
            draw_arrow(list, c, to, width, ink);
        break;
    case Tool::Rotate:
        list.PathArcTo(c, 0.72f * r, -0.35f * kPi, 1.15f * kPi, 24);
        list.PathStroke(ink, 0, width);
        draw_arrow(list, at(0.1f, -0.76f), at(0.2f, -0.71f), width, ink);
        draw_arrow(list, at(0.56f, -0.52f), at(0.2f, -0.72f), width, ink);
        break;
    case Tool::Draw:
        list.AddBezierCubic(at(-0.8f, 0.7f), at(-0.5f, -0.9f), at(0.4f, 0.9f),
                            at(0.8f, -0.7f), ink, width);
        for (const ImVec2 point : {at(-0.8f, 0.7f), at(0.0f, 0.0f), at(0.8f, -0.7f)})
            list.AddCircleFilled(point, 0.2f * r, ink, 12);
        break;
    }
}

/// A button with the tool's picture, and its name below where \p height has room for it.
bool tool_button(const ToolName& tool, bool is_on, ImVec2 size)
{
    const ImVec2 corner = ImGui::GetCursorScreenPos();
    const bool is_pressed = ImGui::InvisibleButton(tool.name, size);
    const bool is_hovered = ImGui::IsItemHovered();
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const ImVec2 end(corner.x + size.x, corner.y + size.y);
    ImVec4 ground = palette().accent;
    ground.w = is_on ? 0.35f : 0.14f;
    if (is_on || is_hovered)
        list.AddRectFilled(corner, end, packed(ground), letters(0.5f));
    if (has_keyboard())
        list.AddRect(corner, end, packed(palette().accent), letters(0.5f), 0,
                     letters(0.2f));
    const ImU32 ink = ImGui::GetColorU32(ImGuiCol_Text);
    const float picture = letters(kToolSide);
    const bool shows_name = size.y > 1.1f * picture;
    draw_icon(list, tool.tool,
              {corner.x + size.x / 2,
               corner.y + (shows_name ? 0.45f * picture : 0.5f * size.y)},
              (shows_name ? 0.24f : 0.27f) * picture, ink);
    if (shows_name)
    {
        ImGui::PushFont(small_font());
        const ImVec2 text = ImGui::CalcTextSize(tool.name);
        list.AddText({corner.x + (size.x - text.x) / 2, end.y - text.y - letters(0.2f)},
                     ink, tool.name);
        ImGui::PopFont();
    }
    tip(tool.tip);
    return is_pressed;
}

void show_file_menu(EditorApp& app)
{
    const bool has_document = app.opened() != nullptr;
    if (ImGui::MenuItem("Open…", "Ctrl+O"))
        app.choosing = Choosing::Open;
    if (ImGui::BeginMenu("Open recent", !app.recent.paths().empty()))
    {
        // A copy: opening one changes the list.
        const std::vector<std::string> paths = app.recent.paths();
        for (const std::string& path : paths)
            if (ImGui::MenuItem(path.c_str()))
                app.ask_to_open(path);
        ImGui::EndMenu();
    }
    ImGui::Separator();
    if (ImGui::MenuItem("Save", "Ctrl+S", false, has_document))
        app.save();
    if (ImGui::MenuItem("Save as…", "Ctrl+Shift+S", false, has_document))
        app.choosing = Choosing::SaveAs;
    ImGui::Separator();
    const auto show_export =
        [&](const char* name, const char* key, Choosing what, const std::string& why)
    {
        if (ImGui::MenuItem(name, key, false, has_document && why.empty()))
            app.choose_export(what);
        if (!why.empty())
            tip(("Cannot be exported now: " + why).c_str());
    };
    const Editing* const editing = has_document ? &app.opened()->editing : nullptr;
    show_export(editing != nullptr && editing->shows_film() ? "Export this frame…"
                                                            : "Export model…",
                "Ctrl+E", Choosing::ExportModel,
                editing != nullptr ? editing->why_no_export() : "");
    show_export("Export field…", nullptr, Choosing::ExportField,
                editing != nullptr ? editing->why_no_field_export() : "");
    ImGui::Separator();
    if (ImGui::MenuItem("Close", "Ctrl+W", false, has_document))
        app.ask_to_close();
    if (ImGui::MenuItem("Quit", "Ctrl+Q"))
        app.ask_to_quit();
}

void show_edit_menu(EditorApp& app)
{
    const bool has_document = app.opened() != nullptr;
    const bool takes_edits = app.takes_edits();
    const bool can_undo = takes_edits && app.document().can_undo();
    const bool can_redo = takes_edits && app.document().can_redo();
    std::string undo = "Undo", redo = "Redo";
    if (has_document)
    {
        const History& history = app.document().history();
        if (can_undo)
            undo += " " + history.name(history.position() - 1);
        if (can_redo)
            redo += " " + history.name(history.position());
    }
    if (ImGui::MenuItem((undo + "##undo").c_str(), "Ctrl+Z", false, can_undo))
        app.undo();
    if (ImGui::MenuItem((redo + "##redo").c_str(), "Ctrl+Shift+Z", false, can_redo))
        app.redo();
}

void show_rods_menu(EditorApp& app)
{
    const bool takes_edits = app.takes_edits();
    const bool has_point = takes_edits && app.opened()->hand.active_point().has_value();
    const auto item = [&](const char* name, const char* key, Command command, bool is_on)
    {
        if (ImGui::MenuItem(name, key, false, is_on))
            app.opened()->hand.run(command);
    };
    item("Draw a rod or curve", "D", Command::ToolDraw, takes_edits);
    item("Rod from the centre line", "Shift+D", Command::DrawCentreLine, takes_edits);
    tip("Of the limb that is selected, or active; of the whole shape where nothing is");
    ImGui::Separator();
    item("Insert a point", "Shift+N", Command::InsertPoint, has_point);
    item("Let the point go", "U", Command::ReleasePoint, has_point);
    item("Let its direction and twist go", "Shift+U", Command::ReleaseDirection,
         has_point);
    item("Remove the point", "Delete", Command::RemoveRegion, has_point);
}

void show_view_menu(EditorApp& app)
{
    ViewOptions& view = app.view;
    ImGui::MenuItem("Faces", nullptr, &view.shows_faces);
    ImGui::MenuItem("Edges", nullptr, &view.shows_edges);
    ImGui::MenuItem("Region colours", nullptr, &view.shows_regions);
    ImGui::MenuItem("Rest shape as a ghost", nullptr, &view.shows_ghost);
    ImGui::MenuItem("Floor", nullptr, &view.shows_floor);
    ImGui::Separator();
    ImGui::MenuItem("Panel", "N", &app.panel.is_shown, app.opened() != nullptr);
    ImGui::MenuItem("Dark", nullptr, &view.is_dark);
    if (ImGui::MenuItem("Frame selection", "", false, app.opened() != nullptr))
        app.opened()->hand.frame_selection();
}

void show_help_menu(EditorApp& app)
{
    if (ImGui::MenuItem("Keys", "?"))
        app.shows_keys = true;
}

void next_cells(ViewOptions& view)
{
    view.cells = view.cells == CellsShown::No      ? CellsShown::Glass
                 : view.cells == CellsShown::Glass ? CellsShown::Wire
                                                   : CellsShown::No;
}

float button_width(const char* name)
{
    return ImGui::CalcTextSize(name).x + 2 * ImGui::GetStyle().FramePadding.x;
}

constexpr const char* kMore = "View ▾";
constexpr float kOptionsTop = 0.9f; ///< of the bar's buttons [letters]

/// A switch of the view.
struct Switch
{
    const char *name, *tip;
    bool* is_on; ///< null: cells
};

std::array<Switch, 4> view_switches(ViewOptions& view)
{
    return {
        {{"Edges", "The edges of faces", &view.shows_edges},
         {"Colours", "The colours of regions", &view.shows_regions},
         {"Rest shape", "The shape before it was bent, as a ghost", &view.shows_ghost},
         {"Cells", "The cells as glass, as wire, not at all", nullptr}}};
}

bool is_on(const Switch& of, const ViewOptions& view)
{
    return of.is_on ? *of.is_on : view.cells != CellsShown::No;
}

void press(const Switch& of, ViewOptions& view)
{
    if (of.is_on)
        *of.is_on = !*of.is_on;
    else
        next_cells(view);
}

void show_radius(Interaction& hand, float width)
{
    auto radius = static_cast<float>(hand.brush_radius());
    ImGui::SetNextItemWidth(width);
    if (ImGui::SliderFloat("##radius", &radius,
                           static_cast<float>(Interaction::kBrushSmallest),
                           static_cast<float>(Interaction::kBrushLargest), "radius %.0f",
                           ImGuiSliderFlags_Logarithmic))
        hand.set_brush_radius(radius);
    tip("The wheel changes it, too");
}

/// Switches of the view, at the right end of the bar; where there is no room for them,
/// one button opens them as a list, with the brush's radius if \p has_radius.
void show_view_switches(EditorApp& app, bool has_radius)
{
    ViewOptions& view = app.view;
    const float gap = ImGui::GetStyle().ItemSpacing.x;
    const float end = ImGui::GetWindowWidth() - letters(0.6f);
    float width = -gap;
    for (const Switch& of : view_switches(view))
        width += button_width(of.name) + gap;
    if (!has_radius && ImGui::GetCursorPosX() + width <= end)
    {
        ImGui::SetCursorPos({end - width, letters(kOptionsTop)});
        for (const Switch& of : view_switches(view))
        {
            if (toggle(of.name, is_on(of, view)))
                press(of, view);
            tip(of.tip);
            ImGui::SameLine();
        }
        return;
    }
    ImGui::SetCursorPos({std::max(ImGui::GetCursorPosX(), end - button_width(kMore)),
                         letters(kOptionsTop)});
    if (ImGui::Button(kMore))
        ImGui::OpenPopup("switches");
    if (!ImGui::BeginPopup("switches"))
        return;
    if (has_radius)
        show_radius(app.opened()->hand, letters(14));
    for (const Switch& of : view_switches(view))
        if (ImGui::MenuItem(of.name, nullptr, is_on(of, view)))
            press(of, view);
    ImGui::EndPopup();
}

/// What is selected, and what is under the pointer: the nearest sample, where it is at
/// rest, as selectors of scenes want it, and its region.
std::string at_rest(const EditorApp& app)
{
    const OpenedDocument& opened = *app.opened();
    const Document& document = opened.editing.document();
    std::string said;
    if (!document.selection().empty())
        said = counted(static_cast<std::int64_t>(document.selection().count()),
                       "sample selected", "samples selected");
    const std::optional<Hover> hover = opened.hand.hover();
    const bool is_over = !ImGui::IsWindowHovered(ImGuiHoveredFlags_AnyWindow);
    if (!hover || !is_over)
        return said;
    const Eigen::Vector3d& place = document.model()->geometry.samples[hover->sample];
    if (!said.empty())
        said += "     ";
    said += fmt::format("Under the pointer: sample {} ({:.6g}  {:.6g}  {:.6g})",
                        hover->sample, place.x(), place.y(), place.z());
    // The hover may be older than the document.
    if (hover->region < 0 || idx(hover->region) >= document.regions().size())
        return said;
    const EditedRegion& region = document.regions()[idx(hover->region)];
    return said + " of " + region.name + " (" + role_name(region.role) + ")";
}

/// The notice of a command, also where the panel that would show it is hidden.
const Notice* seen_notice(const EditorApp& app)
{
    if (!app.panel.is_shown)
        for (const Place place :
             {Place::Regions, Place::Cells, Place::Field, Place::Solver})
            if (const Notice* const notice = app.notice(place))
                return notice;
    return app.notice(Place::Window);
}

} // namespace

float show_menu_bar(EditorApp& app, PanelFocus& focus)
{
    struct Menu
    {
        const char* name;
        void (*show)(EditorApp&);
    };
    constexpr std::array<Menu, 5> kMenus = {{{"File", show_file_menu},
                                             {"Edit", show_edit_menu},
                                             {"Rods", show_rods_menu},
                                             {"View", show_view_menu},
                                             {"Help", show_help_menu}}};
    const std::optional<int> wanted = focus.take_menu_wish();
    float height = 0.0f;
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0.0f);
    const bool is_open = ImGui::BeginMainMenuBar();
    ImGui::PopStyleVar();
    if (!is_open)
        return height;
    height = ImGui::GetWindowHeight();
    constexpr int kCount = static_cast<int>(kMenus.size());
    for (int k = 0; k < kCount; ++k)
    {
        if (wanted == k)
            ImGui::OpenPopup(kMenus[idx(k)].name);
        if (!ImGui::BeginMenu(kMenus[idx(k)].name))
            continue;
        kMenus[idx(k)].show(app);
        ImGui::EndMenu();
        if (const int step = focus.menu_step(); step != 0)
            focus.wish_menu((k + step + kCount) % kCount);
    }
    const std::string title = app.title();
    const float width = ImGui::CalcTextSize(title.c_str()).x;
    const float room = ImGui::GetWindowWidth() - width;
    if (const float left = ImGui::GetCursorPosX(); room > left + letters(1))
    {
        ImGui::SameLine(std::max(room / 2, left + letters(1)));
        ImGui::TextColored(palette().faint, "%s", title.c_str());
    }
    ImGui::EndMainMenuBar();
    return height;
}

void show_tool_column(EditorApp& app, const Layout& layout)
{
    Interaction& hand = app.opened()->hand;
    const float gap = letters(kToolGap);
    const ImVec2 size = layout.shows_names
                            ? ImVec2(letters(kToolHeight), letters(kToolHeight))
                            : ImVec2(letters(kToolSide), letters(kToolSide));
    for (std::size_t k = 0; k < kTools.size(); ++k)
    {
        const auto columns = static_cast<std::size_t>(layout.num_columns);
        ImGui::SetCursorPos({gap + static_cast<float>(k % columns) * (size.x + gap),
                             gap + static_cast<float>(k / columns) * (size.y + gap)});
        if (tool_button(kTools[k], hand.tool() == kTools[k].tool, size))
            hand.set_tool(kTools[k].tool);
    }
}

void show_tool_options(EditorApp& app)
{
    Interaction& hand = app.opened()->hand;
    ImGui::SetCursorPos({letters(0.6f), letters(kOptionsTop)});
    if (Film::is_in(app.document()))
    {
        ImGui::BeginDisabled(!app.takes_edits() && !app.opened()->film);
        if (toggle("Play", app.opened()->film != nullptr))
            app.opened()->film ? app.stop_playing() : app.play();
        ImGui::EndDisabled();
        const std::string poses = Film::poses_of(app.document());
        tip(("What simulate makes of this scene" +
             (poses.empty() ? "" : ": with " + poses))
                .c_str());
        ImGui::SameLine();
        if (app.can_live())
        {
            ImGui::BeginDisabled(!app.takes_edits() && !app.opened()->live);
            if (toggle("Live", app.opened()->live != nullptr))
                app.opened()->live ? app.stop_playing() : app.live();
            ImGui::EndDisabled();
            tip(("Flesh follows in real time, with " + poses +
                 ": take its bones by their joints")
                    .c_str());
            ImGui::SameLine();
        }
    }
    const Tool tool = hand.tool();
    if (tool == Tool::Box || tool == Tool::Lasso || tool == Tool::Brush)
    {
        if (toggle("Through", hand.selects_through()))
            hand.set_selects_through(!hand.selects_through());
        tip("Select also what is hidden (Alt+Z)");
        ImGui::SameLine();
    }
    const float room = ImGui::GetWindowWidth() - ImGui::GetCursorPosX() -
                       button_width(kMore) - letters(2);
    const bool has_room = room >= letters(9);
    if (tool == Tool::Brush && has_room)
    {
        show_radius(hand, std::min(room, letters(14)));
        ImGui::SameLine();
    }
    show_view_switches(app, tool == Tool::Brush && !has_room);
}

void show_film_bar(EditorApp& app, const ViewRect& view)
{
    OpenedDocument* const opened = app.opened();
    if (opened == nullptr || (!opened->film && !opened->live))
        return;
    const std::string poses = Film::poses_of(app.document());
    const float width =
        std::min(static_cast<float>(view.width) - letters(1), letters(70));
    ImGui::SetNextWindowPos({static_cast<float>(view.x + view.width / 2) - width / 2,
                             static_cast<float>(view.y + view.height) -
                                 letters(poses.empty() ? 6.0f : 8.6f)});
    ImGui::SetNextWindowSize({width, 0});
    ImGui::Begin("film", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoSavedSettings);
    if (ImGui::Button("Stop"))
    {
        app.stop_playing();
        ImGui::End();
        return;
    }
    tip("Back to what is edited");
    ImGui::SameLine();
    if (opened->live)
    {
        ImGui::AlignTextToFramePadding();
        ImGui::TextWrapped("Live, with %s", poses.c_str());
        ImGui::End();
        return;
    }
    const Film& film = *opened->film;
    const std::int64_t made = film.num_made();
    ImGui::BeginDisabled(made == 0);
    if (ImGui::Button(opened->film_stands ? "Go on" : "Hold") && made > 0)
        app.show_film_frame(std::clamp<std::int64_t>(opened->film_frame, 0, made - 1),
                            !opened->film_stands);
    ImGui::SameLine();
    std::int64_t frame = std::max<std::int64_t>(0, opened->film_frame);
    const std::int64_t first = 0, last = std::max<std::int64_t>(0, made - 1);
    ImGui::SetNextItemWidth(-std::min(letters(22), 0.3f * width));
    if (ImGui::SliderScalar("##frame", ImGuiDataType_S64, &frame, &first, &last,
                            "%lld") &&
        made > 0)
        app.show_film_frame(std::clamp<std::int64_t>(frame, 0, made - 1), true);
    ImGui::EndDisabled();
    ImGui::SameLine();
    faint_text(film.is_working()
                   ? fmt::format("{} of {} frames", std::max<std::int64_t>(0, made),
                                 film.last() < 0 ? "…" : std::to_string(film.last() + 1))
                   : fmt::format("{:.2f} s",
                                 static_cast<double>(frame) * film.seconds_a_frame()));
    if (!poses.empty())
        ImGui::TextWrapped("With %s", poses.c_str());
    ImGui::End();
}

void show_status_bar(EditorApp& app)
{
    ImGui::AlignTextToFramePadding();
    ImGui::SetCursorPosX(letters(1.2f));
    std::string said;
    ImVec4 colour = ImGui::GetStyleColorVec4(ImGuiCol_Text);
    if (const Notice* notice = seen_notice(app))
    {
        said = notice->text;
        if (notice->is_error)
            colour = palette().error;
    }
    else if (app.is_opening())
        said = "Reading " +
               std::filesystem::path(app.opening_path()).filename().string() + "…";
    else if (app.opened() != nullptr)
    {
        const Interaction& hand = app.opened()->hand;
        said = hand.complaint();
        if (!said.empty())
            colour = palette().warning;
        else
            said = hand.status();
        if (said.empty())
            said = at_rest(app);
    }
    ImGui::TextColored(colour, "%s", said.c_str());
    if (app.opened() == nullptr)
        return;
    const DragStatus drag = app.opened()->editing.drag_status();
    std::string times;
    if (drag.is_dragging && drag.frames > 0)
        times = "latency " + rounded(drag.latency_ms) + " ms     ";
    times += "frame " + rounded(app.frame_times.median()) + " ms, worst " +
             rounded(app.frame_times.worst()) + " ms";
    ImGui::SameLine(ImGui::GetWindowWidth() - ImGui::CalcTextSize(times.c_str()).x -
                    letters(1.2f));
    ImGui::TextColored(palette().faint, "%s", times.c_str());
}

} // namespace cellwarp::core
