// SPDX-License-Identifier: GPL-3.0-or-later
// What is shown where no document is, and the list of keys.
#include <algorithm>
#include <filesystem>
#include <string>

#include <imgui.h>

#include "editor/window/panels.h"
#include "editor/window/style.h"
#include "editor/window/widgets.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kRecentShown = 6;

void show_paths(EditorApp& app, const char* heading,
                const std::vector<std::string>& paths, bool shows_folder)
{
    if (paths.empty())
        return;
    ImGui::Dummy({0, letters(1)});
    faint_text(heading);
    for (std::size_t k = 0; k < paths.size(); ++k)
    {
        const std::filesystem::path path(paths[k]);
        ImGui::PushID(static_cast<int>(k));
        if (ImGui::Selectable((shows_folder ? path.filename() : path.stem()).c_str()))
            app.ask_to_open(paths[k]);
        if (shows_folder)
        {
            ImGui::SameLine(letters(26));
            ImGui::PushStyleColor(ImGuiCol_Text, palette().faint);
            ImGui::TextUnformatted(path.parent_path().c_str());
            ImGui::PopStyleColor();
        }
        ImGui::PopID();
    }
}

/// Names of the samples, as many side by side as there is room for.
void show_samples(EditorApp& app)
{
    static const std::vector<std::string> samples = sample_scenes();
    if (samples.empty())
        return;
    ImGui::Dummy({0, letters(1)});
    faint_text("Samples");
    const float right = ImGui::GetCursorPosX() + ImGui::GetContentRegionAvail().x;
    for (std::size_t k = 0; k < samples.size(); ++k)
    {
        const std::string name = std::filesystem::path(samples[k]).stem().string();
        const float width =
            ImGui::CalcTextSize(name.c_str()).x + 2 * ImGui::GetStyle().FramePadding.x;
        if (k > 0)
        {
            ImGui::SameLine();
            if (ImGui::GetCursorPosX() + width > right)
                ImGui::NewLine();
        }
        if (ImGui::Button(name.c_str()))
            app.ask_to_open(samples[k]);
    }
}

/// Groups one below the other, in two columns of about the same height.
void show_keys(const std::vector<KeyHelp>& lines)
{
    const std::vector<std::pair<const char*, const char*>> of_window = {
        {"Ctrl+O", "open"},
        {"Ctrl+S", "save; with Shift: as"},
        {"Ctrl+E", "export the bent model"},
        {"Ctrl+W, Ctrl+Q", "close, quit"}};
    const std::vector<std::pair<const char*, const char*>> of_panels = {
        {"N", "show or hide the panel; drag its edge: its width"},
        {"F6, Shift+F6",
         "the keyboard goes to the tools, the options, the panel, and back"},
        {"F10", "menus"},
        {"Tab, arrows", "the next control"},
        {"Enter or Space", "press it, or type its number"},
        {"Esc", "close a menu or dialog; back to the view"},
        {"?", "this page"}};
    std::vector<KeyHelp> all = lines;
    for (const auto& [keys, does] : of_window)
        all.push_back({"Files", keys, does});
    for (const auto& [keys, does] : of_panels)
        all.push_back({"Panels, menus, dialogs", keys, does});
    const std::size_t half = (all.size() + 1) / 2;
    if (!ImGui::BeginTable("columns", 2, ImGuiTableFlags_SizingStretchSame))
        return;
    ImGui::TableNextColumn();
    std::string group;
    bool is_second = false;
    for (std::size_t k = 0; k < all.size(); ++k)
    {
        if (all[k].group != group)
        {
            group = all[k].group;
            if (k >= half && !is_second)
            {
                is_second = true;
                ImGui::TableNextColumn();
            }
            ImGui::Dummy({0, letters(0.4f)});
            ImGui::TextColored(palette().accent, "%s", group.c_str());
        }
        const float left = ImGui::GetCursorPosX();
        ImGui::TextUnformatted(all[k].keys.c_str());
        // Where the keys need more room, what they do goes below them.
        const float column =
            std::min(letters(25.5f), 0.45f * ImGui::GetContentRegionAvail().x);
        const bool fits =
            ImGui::CalcTextSize(all[k].keys.c_str()).x < column - letters(0.5f);
        if (fits)
            ImGui::SameLine();
        ImGui::SetCursorPosX(left + column);
        ImGui::PushStyleColor(ImGuiCol_Text, palette().faint);
        ImGui::TextWrapped("%s", all[k].does.c_str());
        ImGui::PopStyleColor();
    }
    ImGui::EndTable();
}

} // namespace

void show_welcome_page(EditorApp& app, const ViewRect& view)
{
    if (app.opened() != nullptr)
        return;
    const float width = std::min(letters(72), static_cast<float>(view.width));
    ImGui::SetNextWindowPos(
        {static_cast<float>(view.x) + static_cast<float>(view.width) / 2,
         static_cast<float>(view.y) + static_cast<float>(view.height) * 0.46f},
        ImGuiCond_Always, {0.5f, 0.5f});
    ImGui::SetNextWindowSize({width, 0});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1.0f);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {letters(4), letters(3.2f)});
    ImGui::Begin("welcome", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoFocusOnAppearing |
                     ImGuiWindowFlags_NoBringToFrontOnFocus);
    if (app.is_opening())
    {
        ImGui::PushFont(heading_font());
        ImGui::TextUnformatted("Reading…");
        ImGui::PopFont();
        faint_text(app.opening_path());
    }
    else
    {
        ImGui::PushFont(heading_font());
        ImGui::TextUnformatted("Grab a shape and bend it");
        ImGui::PopFont();
        ImGui::Dummy({0, letters(0.3f)});
        faint_text(
            "Drop a model or a scene here: OBJ, PLY, STL, OFF, glTF, PCD, XYZ, or a "
            "scene (JSON).");
        if (const Notice* notice = app.notice(Place::Window);
            notice != nullptr && notice->is_error)
        {
            ImGui::Dummy({0, letters(0.4f)});
            error_text(notice->text);
        }
        ImGui::Dummy({0, letters(0.6f)});
        ImVec4 colour = palette().accent;
        colour.w = 0.9f;
        ImGui::PushStyleColor(ImGuiCol_Button, colour);
        ImGui::PushStyleColor(ImGuiCol_Text, {1.0f, 1.0f, 1.0f, 1.0f});
        ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {letters(2), letters(0.9f)});
        if (ImGui::Button("Open a file…"))
            app.choosing = Choosing::Open;
        ImGui::PopStyleVar();
        ImGui::PopStyleColor(2);
        std::vector<std::string> recent = app.recent.paths();
        recent.resize(std::min(recent.size(), kRecentShown));
        show_paths(app, "Recent files", recent, true);
        show_samples(app);
    }
    ImGui::End();
    ImGui::PopStyleVar(2);
}

void show_keys_page(EditorApp& app)
{
    constexpr const char* kTitle = "Keys##keys";
    if (!app.shows_keys)
        return;
    if (!ImGui::IsPopupOpen(kTitle))
        ImGui::OpenPopup(kTitle);
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowPos({size.x / 2, size.y / 2}, ImGuiCond_Always, {0.5f, 0.5f});
    const float width = std::min(letters(134), size.x - letters(4));
    ImGui::SetNextWindowSize({width, 0});
    ImGui::SetNextWindowSizeConstraints({width, 0}, {width, size.y - letters(2)});
    if (!ImGui::BeginPopupModal(kTitle, &app.shows_keys,
                                ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove))
        return;
    const Navigation navigation =
        app.opened() != nullptr ? app.opened()->hand.navigation() : Navigation::Blender;
    show_keys(key_help(navigation));
    const auto is_pressed = [](ImGuiKey key)
    { return ImGui::IsKeyPressed(ImGui::GetKeyIndex(key)); };
    const float step = (is_pressed(ImGuiKey_DownArrow) ? 3.0f : 0.0f) -
                       (is_pressed(ImGuiKey_UpArrow) ? 3.0f : 0.0f) +
                       (is_pressed(ImGuiKey_PageDown) ? 20.0f : 0.0f) -
                       (is_pressed(ImGuiKey_PageUp) ? 20.0f : 0.0f);
    if (step != 0.0f)
        ImGui::SetScrollY(ImGui::GetScrollY() +
                          step * ImGui::GetTextLineHeightWithSpacing());
    if (is_pressed(ImGuiKey_Escape) || is_pressed(ImGuiKey_Enter) ||
        is_pressed(ImGuiKey_KeyPadEnter))
        app.shows_keys = false;
    if (!app.shows_keys)
        ImGui::CloseCurrentPopup();
    ImGui::EndPopup();
}

} // namespace cellwarp::core
