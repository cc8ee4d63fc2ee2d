// SPDX-License-Identifier: GPL-3.0-or-later
// The window and the app in it: events go to the panels or to the hand, and a frame is
// drawn. Scripts and people use the same way through.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "editor/window/canvas.h"
#include "editor/window/dialogs.h"
#include "editor/window/editor_app.h"
#include "editor/window/frame_times.h"
#include "editor/window/layout.h"
#include "editor/window/panel_focus.h"
#include "editor/window/panels.h"
#include "editor/window/window.h"

namespace cellwarp::core
{

/// Where the time of a frame went [ms].
struct FrameParts
{
    double update = 0.0; ///< of document and hand
    double upload = 0.0, draw = 0.0;
    double total = 0.0;     ///< from the first event to the drawn frame
    bool is_drawn = false;  ///< the view was; else its last picture was shown again
    bool is_coarse = false; ///< with fewer triangles, for it would take long
};

class Editor
{
public:
    Editor(const WindowOptions& options, bool keeps_journals);
    ~Editor();

    /// Until the user quits, or \p signal is not 0 any more: then the session ends as
    /// end_session() does.
    void run(const std::atomic<int>& signal);

    /// Takes the events that are there and draws a frame.
    FrameParts frame();
    /// Whether the last frame showed all triangles that there are: see Canvas.
    bool is_whole() const { return canvas_.is_whole(); }
    Window& window() { return window_; }
    EditorApp& app() { return app_; }
    /// Of the last frame.
    const ViewRect& view() const { return layout_.view; }
    Image image() const { return window_.image(); }

private:
    void handle_events();
    void handle(const InputEvent& event);
    void handle_pointer(const InputEvent& event, Interaction& hand);
    bool handle_shortcut(const InputEvent& event);
    int dialog() const;
    bool panels_have(const InputEvent& event) const;
    std::string words() const;
    LayoutSizes sizes() const;
    void show_panels();
    void show_splitter();
    bool is_at_work();
    double draw_canvas();

    Window window_;
    EditorApp app_;
    Canvas canvas_;
    PanelState panels_;
    FileDialog file_dialog_;
    PanelFocus focus_;
    Layout layout_;
    float menu_height_ = 0.0f;
    std::uint32_t held_in_view_ =
        0;                ///< buttons that were pressed in the view, a bit each
    bool is_dark_ = true; ///< as it is drawn now
    std::string title_;
    std::string words_;                     ///< that were drawn last
    const OpenedDocument* drawn_ = nullptr; ///< whose shape the canvas has
    bool is_drawn_ = false;   ///< this frame: the view, not its last picture
    bool draws_all_ = false;  ///< this frame: no coarse triangles
    bool draws_less_ = false; ///< this frame, for it would be slow
    LastFrames whole_frames_; ///< of that shape
};

} // namespace cellwarp::core
