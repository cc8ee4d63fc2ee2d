// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/editor.h"

#include <algorithm>
#include <cctype>

#include <imgui.h>
#include <imgui_internal.h>

#include "editor/window/overlay.h"
#include "editor/window/style.h"
#include "editor/window/widgets.h"
#include "octree/base/clock.h"

namespace cellwarp
{

namespace
{

constexpr float kPanelWidth = 36.0f; ///< [letters]
/// While a result is made, or a handle is in the hand, new shapes are looked for this
/// often [s].
constexpr double kBusyWait = 0.004;
/// How long nothing is looked at while nothing happens [s].
constexpr double kIdleWait = 0.25;
/// Progress and messages are drawn anew this often [s].
constexpr double kProgressStep = 0.1;
/// A frame with all triangles that takes longer is slow [ms].
constexpr double kSlowFrame = 20.0;
/// A slow frame with all triangles is drawn when no event has come for so long [s].
constexpr double kHandRests = 0.25;
/// ImGui needs another frame or two after an event to settle.
constexpr int kFramesAfterEvent = 3;

std::uint32_t bit_of(Button button)
{
    return 1u << static_cast<unsigned>(button);
}

bool is_pointer(const InputEvent& event)
{
    return event.kind == InputEvent::Kind::Move ||
           event.kind == InputEvent::Kind::Press ||
           event.kind == InputEvent::Kind::Release;
}

} // namespace

Editor::Editor(const WindowOptions& options, bool keeps_journals)
    : window_(options), app_(keeps_journals)
{
    app_.view.is_dark = is_dark_ = options.is_dark;
    lay_out();
}

Editor::~Editor() = default;

void Editor::lay_out()
{
    // Widths follow the font, which there is from the first frame on.
    const float scale = static_cast<float>(window_.scale());
    const float letter = 15.0f * scale * 0.62f;
    const bool has_document = app_.opened() != nullptr;
    const float panel = has_document ? kPanelWidth * letter : 0.0f;
    const float tools = has_document ? 4.8f * letter : 0.0f;
    const float status = 3.2f * letter;
    view_.x = 0;
    view_.y = static_cast<int>(menu_height_ + tools);
    view_.width =
        std::max(0, static_cast<int>(static_cast<float>(window_.width()) - panel));
    view_.height = std::max(
        0, static_cast<int>(static_cast<float>(window_.height() - view_.y) - status));
}

bool Editor::panels_have(const InputEvent& event) const
{
    const bool has_popup = ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopupId |
                                                      ImGuiPopupFlags_AnyPopupLevel);
    if (has_popup || app_.choosing || app_.leaving != Leaving::No ||
        app_.asks_to_recover || !app_.asks_to_overwrite.empty() || app_.shows_keys)
        return true;
    if (is_pointer(event) || event.kind == InputEvent::Kind::Wheel)
        return false; // told by the place
    return ImGui::GetIO().WantTextInput;
}

bool Editor::handle_shortcut(const InputEvent& event)
{
    if (event.kind != InputEvent::Kind::KeyDown || !event.modifiers.control)
        return false;
    const bool has_document = app_.opened() != nullptr;
    switch (event.key.character)
    {
    case 'o':
        app_.choosing = Choosing::Open;
        return true;
    case 's':
        if (has_document && event.modifiers.shift)
            app_.choosing = Choosing::SaveAs;
        else
            app_.save();
        return true;
    case 'e':
        app_.choose_export(Choosing::ExportModel);
        return true;
    case 'w':
        app_.ask_to_close();
        return true;
    case 'q':
        app_.ask_to_quit();
        return true;
    default:
        return false;
    }
}

void Editor::handle_pointer(const InputEvent& event, Interaction& hand)
{
    const Eigen::Vector2d pixel =
        (event.place - Eigen::Vector2d(view_.x, view_.y)) / window_.scale();
    const bool is_over = view_.holds(event.place.x(), event.place.y());
    if (event.kind == InputEvent::Kind::Move)
    {
        if (is_over || held_in_view_ != 0 || hand.is_busy())
            hand.pointer_moved(pixel, event.modifiers);
        return;
    }
    const bool is_press = event.kind == InputEvent::Kind::Press;
    if (is_press ? !is_over : (held_in_view_ & bit_of(event.button)) == 0)
        return;
    held_in_view_ = is_press ? held_in_view_ | bit_of(event.button)
                             : held_in_view_ & ~bit_of(event.button);
    hand.pointer_moved(pixel, event.modifiers);
    hand.button(event.button, is_press, event.modifiers);
}

void Editor::handle(const InputEvent& event)
{
    window_.tell_panels(event);
    if (event.kind == InputEvent::Kind::Drop)
    {
        if (!event.paths.empty())
            app_.ask_to_open(event.paths.front());
        return;
    }
    OpenedDocument* opened = app_.opened();
    if (event.kind == InputEvent::Kind::FocusLost)
    {
        held_in_view_ = 0;
        if (opened != nullptr)
            opened->hand.focus_lost();
        return;
    }
    // A press that began in the view ends there, whatever has opened meanwhile.
    const bool is_held = event.kind == InputEvent::Kind::Release && held_in_view_ != 0;
    if (panels_have(event) && !is_held)
        return;
    // A key that is held down looks around or steps, but commands nothing anew.
    if (event.is_repeated && event.key.key == Key::Character &&
        std::isalpha(static_cast<unsigned char>(event.key.character)) != 0 &&
        !event.modifiers.control)
        return;
    if (handle_shortcut(event))
        return;
    const bool is_question =
        (event.kind == InputEvent::Kind::Text && event.character == '?') ||
        (event.kind == InputEvent::Kind::KeyDown && event.key.character == '?');
    if (is_question)
    {
        app_.shows_keys = true;
        return;
    }
    if (opened == nullptr)
        return;
    if (app_.is_opening())
    {
        held_in_view_ = 0;
        return;
    }
    if (is_pointer(event))
        handle_pointer(event, opened->hand);
    else if (event.kind == InputEvent::Kind::Wheel)
    {
        const ImVec2 at = ImGui::GetIO().MousePos;
        if (view_.holds(static_cast<double>(at.x), static_cast<double>(at.y)))
            opened->hand.wheel(event.place, event.modifiers);
    }
    else if (event.kind == InputEvent::Kind::KeyDown &&
             (event.key.key != Key::Character || event.key.character != 0))
        opened->hand.key(event.key);
    else if (event.kind == InputEvent::Kind::Text && event.modifiers.shift &&
             event.character < 128 &&
             std::isalpha(static_cast<int>(event.character)) == 0 && event.character > 32)
    {
        // What Shift makes of a key: told by its text, see window.cpp.
        KeyEvent key;
        key.character = static_cast<char>(event.character);
        opened->hand.key(key);
    }
}

void Editor::handle_events()
{
    InputEvent event;
    while (window_.take(event))
        app_.guard([&] { handle(event); });
}

void Editor::show_panels()
{
    const ImGuiWindowFlags flags =
        ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
        ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoBringToFrontOnFocus |
        ImGuiWindowFlags_NoNavInputs | ImGuiWindowFlags_NoNavFocus;
    menu_height_ = show_menu_bar(app_);
    lay_out();
    const auto below = static_cast<float>(view_.y + view_.height);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0.0f);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0.0f);
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    if (app_.opened() != nullptr)
    {
        ImGui::SetNextWindowPos({0, menu_height_});
        ImGui::SetNextWindowSize({static_cast<float>(view_.width),
                                  static_cast<float>(view_.y) - menu_height_});
        ImGui::Begin("tools", nullptr, flags | ImGuiWindowFlags_NoScrollWithMouse);
        show_tool_bar(app_);
        ImGui::End();
        ImGui::SetNextWindowPos({static_cast<float>(view_.width), menu_height_});
        ImGui::SetNextWindowSize(
            {size.x - static_cast<float>(view_.width), below - menu_height_});
        ImGui::Begin("panels", nullptr, flags & ~ImGuiWindowFlags_NoScrollbar);
        ImGui::BeginDisabled(app_.is_opening());
        show_document_panel(app_);
        show_regions_panel(app_, panels_);
        show_solver_panel(app_);
        show_history_panel(app_, panels_);
        show_cells_panel(app_, panels_);
        show_field_panel(app_);
        show_view_panel(app_);
        ImGui::EndDisabled();
        ImGui::End();
    }
    ImGui::PushStyleColor(ImGuiCol_WindowBg, palette().bar);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, letters(0.3f)});
    ImGui::SetNextWindowPos({0, below});
    ImGui::SetNextWindowSize({size.x, size.y - below});
    ImGui::Begin("status", nullptr, flags | ImGuiWindowFlags_NoScrollWithMouse);
    show_status_bar(app_);
    ImGui::End();
    ImGui::PopStyleVar(3);
    ImGui::PopStyleColor();
    show_film_bar(app_, view_);
    show_welcome_page(app_, view_);
    file_dialog_.show(app_);
    show_questions(app_);
    show_keys_page(app_);
}

/// \return what copying to the graphics card took [ms]
double Editor::draw_canvas()
{
    OpenedDocument* opened = app_.opened();
    if (drawn_ != opened)
    {
        canvas_.clear();
        drawn_ = opened;
        whole_frames_.clear();
    }
    is_drawn_ = draws_all_ = draws_less_ = false;
    if (opened == nullptr)
    {
        canvas_.draw_empty(app_.view, view_, window_.height());
        return 0.0;
    }
    Editing& editing = opened->editing;
    editing.show_cells(app_.view.cells != CellsShown::No);
    const WorkFrame& frame = editing.view_frame();
    const CanvasScene scene{editing.document(),
                            opened->hand.shown_selection(),
                            editing.shape(),
                            editing.rest_shape(),
                            editing.cells(),
                            opened->hand.camera(),
                            frame.to_work(editing.document().box().low),
                            frame.to_work(editing.document().box().high)};
    const double upload_ms = canvas_.upload(scene, app_.view);
    ViewOptions options = app_.view;
    if (canvas_.show_again(scene, options, view_, window_.height()))
        return upload_ms;
    // Where drawing is slow, all triangles and smooth edges wait until the hand rests and
    // the solver, whose cores the drawing takes, has done its work. Another shape or
    // selection is seen at once that way too: the next frame is whole. A film, which has
    // a new shape in each frame, stays whole.
    const bool is_new = canvas_.has_news() && opened->film == nullptr;
    draws_less_ = (is_at_work() || is_new) && whole_frames_.median() > kSlowFrame;
    if (draws_less_)
    {
        options.detail = Detail::Coarse;
        options.is_smooth = false;
    }
    is_drawn_ = !canvas_.show_again(scene, options, view_, window_.height());
    if (is_drawn_)
        canvas_.draw(scene, options, view_, window_.height());
    draws_all_ = is_drawn_ && !draws_less_ && canvas_.is_whole();
    return upload_ms;
}

FrameParts Editor::frame()
{
    const Clock::time_point start = Clock::now();
    FrameParts parts;
    handle_events();
    app_.update();
    parts.update = ms_since(start);
    if (is_dark_ != app_.view.is_dark)
        window_.set_dark(is_dark_ = app_.view.is_dark);
    const Clock::time_point draw_start = Clock::now();
    window_.begin_frame();
    if (!app_.guard([&] { show_panels(); }))
        ImGui::ErrorCheckEndFrameRecover(nullptr); // ends what panels have begun
    app_.guard(
        [&]
        {
            if (OpenedDocument* opened = app_.opened())
                opened->hand.resize(view_.width / window_.scale(),
                                    view_.height / window_.scale());
            parts.upload = draw_canvas();
            draw_overlay(app_, view_, window_.scale(), canvas_.scale_of_cells());
        });
    window_.draw_panels();
    parts.draw = ms_since(draw_start) - parts.upload;
    parts.total = ms_since(start);
    app_.frame_times.add(seconds_now(), parts.total);
    parts.is_drawn = is_drawn_;
    parts.is_coarse = is_drawn_ && draws_less_;
    if (draws_all_)
        whole_frames_.add(parts.total - parts.upload);
    window_.show_frame();
    if (std::string title = app_.title(); title != title_)
        window_.set_title(title_ = std::move(title));
    return parts;
}

/// What may change by itself with time.
std::string Editor::words() const
{
    std::string words;
    if (const Notice* notice = app_.notice(Place::Window))
        words += notice->text;
    if (const OpenedDocument* opened = app_.opened())
        words += opened->hand.hint() + opened->hand.status() + opened->hand.complaint();
    return words;
}

bool Editor::is_at_work()
{
    const OpenedDocument* const opened = app_.opened();
    return !app_.is_idle() || (opened != nullptr && opened->hand.is_busy());
}

void Editor::run(const std::atomic<int>& signal)
{
    int frames_to_draw = kFramesAfterEvent;
    double last_frame = 0.0, last_event = 0.0;
    while (!app_.wants_to_quit)
    {
        const bool is_idle = app_.is_idle();
        const bool is_behind =
            draws_less_ && !is_at_work() && seconds_now() - last_event > kHandRests;
        window_.wait(frames_to_draw > 0 || is_behind ? 0.0
                     : is_idle && !draws_less_       ? kIdleWait
                                                     : kBusyWait);
        if (signal != 0)
            return app_.end_session();
        if (window_.wants_to_close())
        {
            window_.keep_open();
            app_.ask_to_quit();
            frames_to_draw = kFramesAfterEvent;
        }
        if (window_.has_news())
        {
            frames_to_draw = kFramesAfterEvent;
            last_event = seconds_now();
        }
        if (frames_to_draw == 0)
        {
            const bool is_new = app_.update();
            const bool is_typing = ImGui::GetIO().WantTextInput; // a cursor blinks
            const bool is_late = !is_idle && seconds_now() - last_frame > kProgressStep;
            if (!is_new && !is_typing && !is_late && !is_behind && words() == words_)
                continue;
        }
        frame();
        words_ = words();
        last_frame = seconds_now();
        frames_to_draw = std::max(canvas_.is_whole() ? 0 : 1, frames_to_draw - 1);
    }
}

} // namespace cellwarp
