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

namespace cellwarp::core
{

namespace
{

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

/// The bars around the view.
constexpr ImGuiWindowFlags kBarFlags =
    ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
    ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoBringToFrontOnFocus |
    ImGuiWindowFlags_NoNavFocus;

/// Whether the event may end an open dialog in the frame in which the panels see it.
bool may_end_dialog(const InputEvent& event)
{
    return event.kind == InputEvent::Kind::Release ||
           (event.kind == InputEvent::Kind::KeyDown &&
            (event.key.key == Key::Escape || event.key.key == Key::Enter));
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
    layout_ = lay_out(sizes(), app_.panel);
}

Editor::~Editor() = default;

LayoutSizes Editor::sizes() const
{
    // Widths follow the font, which there is from the first frame on.
    const float letter = 15.0f * static_cast<float>(window_.scale()) * 0.62f;
    return {window_.width(), window_.height(), letter, menu_height_,
            app_.opened() != nullptr ? kNumTools : 0};
}

/// The dialog that covers the window, by a number of its own; 0: none.
int Editor::dialog() const
{
    return app_.choosing                     ? 5 + static_cast<int>(*app_.choosing)
           : !app_.asks_to_overwrite.empty() ? 1
           : app_.leaving != Leaving::No     ? 2
           : app_.asks_to_recover            ? 3
           : app_.shows_keys                 ? 4
                                             : 0;
}

bool Editor::panels_have(const InputEvent& event) const
{
    if (dialog() != 0)
        return true;
    if (event.kind == InputEvent::Kind::Wheel)
    {
        const ImVec2 at = ImGui::GetIO().MousePos;
        return focus_.is_over({static_cast<double>(at.x), static_cast<double>(at.y)});
    }
    if (is_pointer(event))
        return focus_.is_over(event.place);
    return focus_.has_keys();
}

bool Editor::handle_shortcut(const InputEvent& event)
{
    if (event.kind != InputEvent::Kind::KeyDown)
        return false;
    const OpenedDocument* const opened = app_.opened();
    const bool has_document = opened != nullptr;
    const bool is_in_hand =
        has_document && opened->hand.is_busy() && !opened->editing.shows_film();
    if (event.key.character == 'n' && event.modifiers == Modifiers() && has_document &&
        !is_in_hand)
    {
        app_.panel.is_shown = !app_.panel.is_shown;
        return true;
    }
    if (!event.modifiers.control)
        return false;
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
    const ViewRect& view = layout_.view;
    const Eigen::Vector2d pixel =
        (event.place - Eigen::Vector2d(view.x, view.y)) / window_.scale();
    const bool is_over =
        view.holds(event.place.x(), event.place.y()) && !panels_have(event);
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
    if (dialog() == 0)
    {
        if (event.kind == InputEvent::Kind::Press)
            focus_.pressed(event.place);
        else if (focus_.take_key(event, app_.opened() != nullptr))
            return;
    }
    // ImGui would go to a control of its own by a Tab that is meant for the view.
    const bool is_for_view =
        event.kind == InputEvent::Kind::KeyDown && dialog() == 0 && !focus_.has_keys();
    if (!is_for_view)
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
    // A gesture that began in the view goes on there, whatever lies over it meanwhile; it
    // ends even if a dialog has opened.
    const bool is_busy =
        held_in_view_ != 0 || (opened != nullptr && opened->hand.is_busy());
    const bool is_held =
        event.kind == InputEvent::Kind::Release
            ? held_in_view_ != 0
            : event.kind == InputEvent::Kind::Move && is_busy && dialog() == 0;
    if (panels_have(event) && !is_held)
    {
        if (dialog() == 0 && !focus_.is_typing() && !focus_.has_menu() &&
            event.modifiers.control)
            handle_shortcut(event);
        return;
    }
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
        if (layout_.view.holds(static_cast<double>(at.x), static_cast<double>(at.y)))
            opened->hand.wheel(event.place, event.modifiers);
    }
    else if (event.kind == InputEvent::Kind::KeyDown &&
             (event.key.key != Key::Character || event.key.character != 0))
        opened->hand.key(event.key);
    else if (event.kind == InputEvent::Kind::Text &&
             (event.modifiers.shift || event.modifiers.alt) && event.character < 128 &&
             std::isalpha(static_cast<int>(event.character)) == 0 && event.character > 32)
    {
        // The character of a key with Shift or AltGr: see window.cpp.
        KeyEvent key;
        key.character = static_cast<char>(event.character);
        opened->hand.key(key);
    }
}

void Editor::handle_events()
{
    // Events after the opening of a dialog are meant for it, and wait until it is there;
    // those after its end are not, and wait until it is gone.
    InputEvent event;
    while (!focus_.is_settling(dialog()) && window_.take(event))
    {
        app_.guard([&] { handle(event); });
        if (dialog() != 0 && may_end_dialog(event))
            break;
    }
}

/// Between the view and the panel: a drag makes the panel wider, narrower or hidden.
void Editor::show_splitter()
{
    const ViewRect& strip = layout_.splitter;
    const ImVec2 low(static_cast<float>(strip.x), static_cast<float>(strip.y));
    const ImVec2 size(static_cast<float>(strip.width), static_cast<float>(strip.height));
    ImGui::SetNextWindowPos(low);
    ImGui::SetNextWindowSize(size);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, 0});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowMinSize, {1, 1});
    ImGui::PushStyleColor(ImGuiCol_WindowBg, palette().bar);
    ImGui::Begin("splitter", nullptr, kBarFlags | ImGuiWindowFlags_NoNavInputs);
    ImGui::InvisibleButton("##splitter",
                           {std::max(1.0f, size.x), std::max(1.0f, size.y)});
    const bool is_held = ImGui::IsItemActive();
    if (is_held && ImGui::IsMouseDragging(ImGuiMouseButton_Left, 2.0f))
        app_.panel = wish_at(static_cast<double>(ImGui::GetIO().MousePos.x), sizes());
    if (ImGui::IsItemHovered() && ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left))
        app_.panel = {!app_.panel.is_shown, 0.0};
    const float middle = low.y + size.y / 2, x = low.x + size.x / 2;
    const ImU32 ink =
        packed(is_held || ImGui::IsItemHovered() ? palette().accent : palette().faint);
    for (const float dy : {-0.8f, 0.0f, 0.8f})
        ImGui::GetWindowDrawList()->AddCircleFilled({x, middle + letters(dy)},
                                                    0.22f * size.x, ink, 8);
    if (!is_held)
        tip("Drag: the panel's width; N: show or hide it");
    ImGui::End();
    ImGui::PopStyleColor();
    ImGui::PopStyleVar(2);
}

void Editor::show_panels()
{
    const auto place = [](const ViewRect& rect)
    {
        ImGui::SetNextWindowPos({static_cast<float>(rect.x), static_cast<float>(rect.y)});
        ImGui::SetNextWindowSize(
            {static_cast<float>(rect.width), static_cast<float>(rect.height)});
    };
    focus_.enter_wanted();
    // Tab goes to every control, not to text fields alone.
    ImGui::PushItemFlag(ImGuiItemFlags_Inputable, true);
    menu_height_ = show_menu_bar(app_, focus_);
    layout_ = lay_out(sizes(), app_.panel);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0.0f);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0.0f);
    if (app_.opened() != nullptr)
    {
        place(layout_.tools);
        ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, 0});
        ImGui::Begin("tools", nullptr, kBarFlags | ImGuiWindowFlags_NoScrollWithMouse);
        show_tool_column(app_, layout_);
        ImGui::End();
        ImGui::PopStyleVar();
        place(layout_.options);
        ImGui::Begin("options", nullptr, kBarFlags | ImGuiWindowFlags_NoScrollWithMouse);
        show_tool_options(app_);
        ImGui::End();
        show_splitter();
    }
    if (app_.opened() != nullptr && layout_.panel.width > 0)
    {
        place(layout_.panel);
        ImGui::Begin("panels", nullptr, kBarFlags & ~ImGuiWindowFlags_NoScrollbar);
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
    place(layout_.status);
    ImGui::Begin("status", nullptr,
                 kBarFlags | ImGuiWindowFlags_NoScrollWithMouse |
                     ImGuiWindowFlags_NoNavInputs);
    show_status_bar(app_);
    ImGui::End();
    ImGui::PopStyleVar(3);
    ImGui::PopStyleColor();
    show_film_bar(app_, layout_.view);
    show_welcome_page(app_, layout_.view);
    file_dialog_.show(app_);
    show_questions(app_);
    show_keys_page(app_);
    ImGui::PopItemFlag();
    focus_.panels_shown();
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
        canvas_.draw_empty(app_.view, layout_.view, window_.height());
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
    if (canvas_.show_again(scene, options, layout_.view, window_.height()))
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
    is_drawn_ = !canvas_.show_again(scene, options, layout_.view, window_.height());
    if (is_drawn_)
        canvas_.draw(scene, options, layout_.view, window_.height());
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
    focus_.prepare_frame(dialog());
    window_.begin_frame();
    if (!app_.guard([&] { show_panels(); }))
        ImGui::ErrorCheckEndFrameRecover(nullptr); // ends what panels have begun
    app_.guard(
        [&]
        {
            if (OpenedDocument* opened = app_.opened())
                opened->hand.resize(layout_.view.width / window_.scale(),
                                    layout_.view.height / window_.scale());
            parts.upload = draw_canvas();
            draw_overlay(app_, layout_.view, window_.scale(), canvas_.scale_of_cells());
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
            const bool is_typing = focus_.is_typing(); // a cursor blinks
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

} // namespace cellwarp::core
