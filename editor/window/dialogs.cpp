// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/dialogs.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>

#include <imgui.h>
#include <imgui_stdlib.h>

#include "editor/window/style.h"
#include "editor/window/widgets.h"
#include "io/base/text.h"
#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

std::string title_of(Choosing choosing, const OpenedDocument* opened)
{
    switch (choosing)
    {
    case Choosing::Open:
        return "Open a model or a scene";
    case Choosing::SaveAs:
        return "Save scene and handles";
    case Choosing::ExportModel:
        return opened != nullptr && opened->film
                   ? "Export frame " + std::to_string(opened->film_frame)
                   : "Export the bent model";
    case Choosing::ExportField:
        return "Export the field";
    }
    return "";
}

const char* verb_of(Choosing choosing)
{
    return choosing == Choosing::Open     ? "Open"
           : choosing == Choosing::SaveAs ? "Save"
                                          : "Export";
}

/// Formats that are read by io/import alone are told by their names here, too.
bool can_be_opened(const std::string& name)
{
    const std::string extension = extension_of(name);
    constexpr std::array kMore = {"json", "fbx", "dae", "3ds", "x3d", "lwo", "blend"};
    return is_geometry_format(extension) ||
           std::find(kMore.begin(), kMore.end(), extension) != kMore.end();
}

void centre_next_window(float width)
{
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowPos({size.x / 2, size.y * 0.45f}, ImGuiCond_Always, {0.5f, 0.5f});
    ImGui::SetNextWindowSize({std::min(width, size.x - letters(4)), 0});
}

constexpr ImGuiWindowFlags kModal = ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                                    ImGuiWindowFlags_NoSavedSettings;

} // namespace

void FileDialog::begin(EditorApp& app, Choosing choosing)
{
    shown_ = choosing;
    is_taken_ = saves_poses_ = false;
    std::error_code failure;
    const fs::path now = fs::current_path(failure);
    if (folder_.empty())
        folder_ = failure ? "/" : now.string();
    name_.clear();
    OpenedDocument* opened = app.opened();
    if (opened != nullptr && choosing != Choosing::Open)
    {
        const Document& document = opened->editing.document();
        const std::string& scene = document.scene_path();
        const fs::path model = fs::absolute(document.model()->path, failure);
        folder_ =
            (scene.empty() ? model : fs::absolute(scene, failure)).parent_path().string();
        if (choosing == Choosing::SaveAs)
            name_ = scene.empty() ? model.stem().string() + "-edit.json"
                                  : fs::path(scene).filename().string();
        else if (choosing == Choosing::ExportModel)
            name_ = model.stem().string() +
                    (opened->film ? "-" + std::to_string(opened->film_frame) : "-bent") +
                    model.extension().string();
        else
            name_ = model.stem().string() + ".cwf";
    }
    listed_.clear();
}

void FileDialog::list_folder()
{
    if (listed_ == folder_)
        return;
    listed_ = folder_;
    entries_.clear();
    failure_.clear();
    std::error_code failure;
    fs::directory_iterator entry(folder_, failure);
    for (; !failure && entry != fs::directory_iterator(); entry.increment(failure))
    {
        const std::string name = entry->path().filename().string();
        std::error_code none;
        const bool is_folder = entry->is_directory(none);
        if (name.front() != '.' &&
            (is_folder || shown_ != Choosing::Open || can_be_opened(name)))
            entries_.push_back({name, is_folder});
    }
    if (failure)
        failure_ = "This folder cannot be read: " + failure.message();
    std::sort(entries_.begin(), entries_.end(),
              [](const Entry& a, const Entry& b)
              { return a.is_folder != b.is_folder ? a.is_folder : a.name < b.name; });
}

std::string FileDialog::chosen() const
{
    return (fs::path(folder_) / fs::path(name_)).lexically_normal().string();
}

void FileDialog::show_entries(Choosing choosing)
{
    ImGui::PushStyleColor(ImGuiCol_ChildBg, palette().bar);
    const float most = ImGui::GetIO().DisplaySize.y - letters(26);
    ImGui::BeginChild("entries", {0, std::clamp(most, letters(6), letters(38))}, false,
                      ImGuiWindowFlags_AlwaysUseWindowPadding |
                          ImGuiWindowFlags_NavFlattened);
    std::string entered;
    for (const Entry& entry : entries_)
    {
        const std::string text = (entry.is_folder ? "▸  " : "     ") + entry.name;
        const bool is_chosen = entry.name == name_;
        const bool is_pressed = ImGui::Selectable(text.c_str(), is_chosen,
                                                  ImGuiSelectableFlags_AllowDoubleClick);
        if (is_chosen && is_stepped_)
            ImGui::SetScrollHereY();
        if (!is_pressed)
            continue;
        if (entry.is_folder)
            entered = entry.name;
        else
        {
            name_ = entry.name;
            is_taken_ = choosing == Choosing::Open &&
                        (ImGui::IsMouseDoubleClicked(0) || has_keyboard());
        }
    }
    if (!failure_.empty())
        error_text(failure_);
    else if (entries_.empty())
        faint_text("Nothing here that can be opened.");
    ImGui::EndChild();
    ImGui::PopStyleColor();
    if (!entered.empty())
        folder_ = (fs::path(folder_) / entered).string();
}

/// The name of the entry above or below the one that is named.
std::string FileDialog::next_name(int step) const
{
    if (entries_.empty())
        return name_;
    const auto now =
        std::find_if(entries_.begin(), entries_.end(),
                     [&](const Entry& entry) { return entry.name == name_; });
    const std::ptrdiff_t last = std::ssize(entries_) - 1;
    const std::ptrdiff_t next = now != entries_.end() ? now - entries_.begin() + step
                                : step > 0            ? 0
                                                      : last;
    return entries_[idx(std::clamp<std::ptrdiff_t>(next, 0, last))].name;
}

/// The field of the file's name; the arrows go through the list. True: Enter was pressed.
bool FileDialog::show_name()
{
    is_stepped_ = false;
    const auto step = [](ImGuiInputTextCallbackData* data)
    {
        auto& dialog = *static_cast<FileDialog*>(data->UserData);
        const std::string next =
            dialog.next_name(data->EventKey == ImGuiKey_DownArrow ? 1 : -1);
        data->DeleteChars(0, data->BufTextLen);
        data->InsertChars(0, next.c_str());
        dialog.is_stepped_ = true;
        return 0;
    };
    ImGui::SetNextItemWidth(-1);
    if (ImGui::IsWindowAppearing() || std::exchange(wants_keyboard_, false))
        ImGui::SetKeyboardFocusHere();
    return ImGui::InputTextWithHint("##name", "name of the file", &name_,
                                    ImGuiInputTextFlags_EnterReturnsTrue |
                                        ImGuiInputTextFlags_CallbackHistory,
                                    step, this);
}

std::string FileDialog::in_the_way(Choosing choosing) const
{
    if (name_.empty() || choosing == Choosing::Open)
        return "";
    std::error_code none;
    if (fs::is_regular_file(chosen(), none))
        return name_;
    // A scene is written as two files.
    const fs::path handles = fs::path(chosen()).replace_extension(".handles");
    return choosing == Choosing::SaveAs && fs::is_regular_file(handles, none)
               ? handles.filename().string()
               : "";
}

void FileDialog::take(EditorApp& app, Choosing choosing, Overwrite overwrite)
{
    const std::string path = chosen();
    bool is_done = true;
    if (choosing == Choosing::Open)
        app.ask_to_open(path);
    else
        is_done = app.attempt(Place::Window,
                              [&]
                              {
                                  Editing& editing = app.opened()->editing;
                                  if (choosing == Choosing::SaveAs)
                                      app.document().save(path, overwrite,
                                                          saves_poses_ ? SavedPart::Poses
                                                                       : SavedPart::All);
                                  else if (choosing == Choosing::ExportModel)
                                      editing.export_model(path, overwrite);
                                  else
                                      app.export_field(path, overwrite);
                              });
    if (!is_done)
        return;
    if (choosing == Choosing::SaveAs || choosing == Choosing::ExportModel)
        app.say(Place::Window, "Written: " + path);
    if (choosing == Choosing::SaveAs)
        app.recent.add(path);
    app.choosing.reset();
    if (choosing == Choosing::SaveAs && app.leaves_when_saved)
    {
        app.leaves_when_saved = false;
        app.leave(false);
    }
}

void FileDialog::show(EditorApp& app)
{
    if (!app.choosing)
    {
        shown_.reset();
        return;
    }
    const Choosing choosing = *app.choosing;
    if (shown_ != choosing)
        begin(app, choosing);
    const std::string title = title_of(choosing, app.opened()) + "##file";
    if (!ImGui::IsPopupOpen(title.c_str()))
        ImGui::OpenPopup(title.c_str());
    centre_next_window(letters(84));
    if (!ImGui::BeginPopupModal(title.c_str(), nullptr, kModal))
        return;
    list_folder();
    if (ImGui::Button("Up"))
        folder_ = fs::path(folder_).parent_path().string();
    ImGui::SameLine();
    std::string typed = folder_;
    ImGui::SetNextItemWidth(-1);
    if (ImGui::InputText("##folder", &typed, ImGuiInputTextFlags_EnterReturnsTrue) &&
        !typed.empty())
        folder_ = typed;
    show_entries(choosing);
    const bool is_entered = show_name();
    if (const Notice* notice = app.notice(Place::Window); notice && notice->is_error)
        error_text(notice->text);
    if (choosing == Choosing::SaveAs && app.document().has_keys_of_scene())
    {
        ImGui::Checkbox("The poses alone: without times, flesh and simulate",
                        &saves_poses_);
        if (const std::string why = app.document().why_not_whole();
            !why.empty() && !saves_poses_)
            warning_text("Else it cannot be saved: " + why);
    }
    std::error_code none;
    const std::string old = in_the_way(choosing);
    const bool replaces = !old.empty();
    if (replaces)
        warning_text("There is a file " + old + "; it will be replaced.");
    ImGui::Dummy({0, letters(0.5f)});
    const ImVec2 size = {letters(14), 0};
    ImGui::SetCursorPosX(ImGui::GetWindowWidth() - 2 * size.x -
                         ImGui::GetStyle().ItemSpacing.x -
                         ImGui::GetStyle().WindowPadding.x);
    if (ImGui::Button("Cancel", size) ||
        ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape)))
    {
        app.choosing.reset();
        app.leaves_when_saved = false;
        app.stay();
    }
    ImGui::SameLine();
    ImGui::BeginDisabled(name_.empty());
    const bool is_pressed = ImGui::Button(replaces ? "Replace" : verb_of(choosing), size);
    ImGui::EndDisabled();
    if ((is_pressed || is_entered || is_taken_) && !name_.empty() && app.choosing)
    {
        is_taken_ = false;
        if (fs::is_directory(chosen(), none))
        {
            folder_ = chosen();
            name_.clear();
            wants_keyboard_ = true;
        }
        else
            take(app, choosing, replaces ? Overwrite::Yes : Overwrite::No);
    }
    if (!app.choosing)
        ImGui::CloseCurrentPopup();
    ImGui::EndPopup();
}

namespace
{

void ask_about_changes(EditorApp& app)
{
    if (app.leaving == Leaving::No || app.choosing || !app.asks_to_overwrite.empty())
        return;
    constexpr const char* kTitle = "Unsaved changes##leave";
    if (!ImGui::IsPopupOpen(kTitle))
        ImGui::OpenPopup(kTitle);
    centre_next_window(letters(58));
    if (!ImGui::BeginPopupModal(kTitle, nullptr, kModal))
        return;
    ImGui::TextWrapped("Save the changes before this is closed?");
    faint_text("Without saving, the edits since the last save are lost.");
    ImGui::Dummy({0, letters(0.8f)});
    const ImVec2 size = {letters(14), 0};
    const auto done = [] { ImGui::CloseCurrentPopup(); };
    if (ImGui::Button("Save", size))
    {
        done();
        app.leave(true);
    }
    ImGui::SameLine();
    if (ImGui::Button("Do not save", size))
    {
        done();
        app.leave(false);
    }
    ImGui::SameLine();
    if (ImGui::Button("Cancel", size) ||
        ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape)))
    {
        done();
        app.stay();
    }
    ImGui::EndPopup();
}

void ask_to_overwrite(EditorApp& app)
{
    if (app.asks_to_overwrite.empty() || app.opened() == nullptr)
        return;
    constexpr const char* kTitle = "Changed by another program##overwrite";
    if (!ImGui::IsPopupOpen(kTitle))
        ImGui::OpenPopup(kTitle);
    centre_next_window(letters(62));
    if (!ImGui::BeginPopupModal(kTitle, nullptr, kModal))
        return;
    ImGui::TextWrapped("%s.", app.asks_to_overwrite.c_str());
    faint_text("Overwriting it loses those changes.");
    ImGui::Dummy({0, letters(0.8f)});
    const ImVec2 size = {letters(14), 0};
    const auto answer = [&](void (EditorApp::*done)())
    {
        ImGui::CloseCurrentPopup();
        (app.*done)();
    };
    if (ImGui::Button("Overwrite", size))
        answer(&EditorApp::overwrite);
    ImGui::SameLine();
    if (ImGui::Button("Save as", size))
        answer(&EditorApp::save_elsewhere);
    ImGui::SetItemDefaultFocus(); // Enter overwrites nothing
    ImGui::SameLine();
    if (ImGui::Button("Cancel", size) ||
        ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape)))
        answer(&EditorApp::cancel_save);
    ImGui::EndPopup();
}

void ask_to_recover(EditorApp& app)
{
    if (!app.asks_to_recover || app.opened() == nullptr)
        return;
    constexpr const char* kTitle = "The last session did not end well##recover";
    if (!ImGui::IsPopupOpen(kTitle))
        ImGui::OpenPopup(kTitle);
    centre_next_window(letters(62));
    if (!ImGui::BeginPopupModal(kTitle, nullptr, kModal))
        return;
    const auto count = static_cast<std::int64_t>(app.document().num_recoverable());
    ImGui::TextWrapped("%s of this file can be recovered.",
                       counted(count, "edit", "edits").c_str());
    ImGui::Dummy({0, letters(0.8f)});
    const ImVec2 size = {letters(14), 0};
    if (ImGui::Button("Recover", size))
    {
        app.asks_to_recover = false;
        app.attempt(Place::Window,
                    [&]
                    {
                        const auto warnings = app.document().recover();
                        app.say(Place::Window,
                                warnings.empty() ? "Recovered" : warnings.front());
                    });
        ImGui::CloseCurrentPopup();
    }
    ImGui::SameLine();
    if (ImGui::Button("Drop them", size))
    {
        app.asks_to_recover = false;
        app.attempt(Place::Window, [&] { app.document().drop_recoverable(); });
        ImGui::CloseCurrentPopup();
    }
    ImGui::SameLine();
    if (ImGui::Button("Close", size) ||
        ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape)))
    {
        ImGui::CloseCurrentPopup();
        app.close();
    }
    tip("Closes the file; its edits can be recovered when it is opened again");
    ImGui::EndPopup();
}

} // namespace

void show_questions(EditorApp& app)
{
    ask_to_overwrite(app);
    ask_about_changes(app);
    ask_to_recover(app);
}

} // namespace cellwarp::core
