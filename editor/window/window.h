// SPDX-License-Identifier: GPL-3.0-or-later
// A window of the system with OpenGL and ImGui in it: events come out, frames go in. The
// one place that knows GLFW.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/window/events.h"
#include "io/image.h"

struct GLFWwindow;

namespace cellwarp
{

struct WindowOptions
{
    /// In the editor's pixels, or as many as the display has room for; of a played one
    /// [pixel of the screen].
    int width = 1400, height = 900;
    double scale = 0.0; ///< pixels of the screen for one of ours; 0: the display's
    bool is_dark = true;
    /// Events are posted, those of the display are left out, and frames are shown without
    /// waiting for it.
    bool is_played = false;
};

/// The event of a key by its name: "g", "?", "enter", "kp7"; none: there is no such key.
std::optional<InputEvent> key_press(const std::string& name, const Modifiers& modifiers);

/// A window's size, smaller where a screen has no room for it and its title; where its
/// room is not known (0) as wanted. \p wanted: in the editor's pixels, \p scale of the
/// screen's each; the others [pixel of the screen].
Eigen::Vector2i size_within(const Eigen::Vector2i& wanted, double scale,
                            const Eigen::Vector2i& room);

class Window
{
public:
    /// Throws Fault::Usage where there is no display, or one without OpenGL 3.3.
    explicit Window(const WindowOptions& options);
    ~Window();
    Window(const Window&) = delete;
    Window& operator=(const Window&) = delete;

    /// Sleeps until something happens, at the most \p seconds; 0: does not sleep.
    void wait(double seconds);
    /// The next one that has not been taken; false: none. Real and posted ones alike.
    bool take(InputEvent& event);
    /// Adds one at the end, as if the user had done it.
    void post(InputEvent event);
    /// Something happened that has not been drawn.
    bool has_news() const { return !events_.empty() || is_damaged_; }

    int width() const; ///< [pixel of the screen]
    int height() const;
    double scale() const { return scale_; }
    bool wants_to_close() const;
    void keep_open();
    void set_title(const std::string& title);
    void resize(int width, int height);
    void set_dark(bool is_dark);

    /// Tells ImGui of an event. A press and a release between two
    /// frames are both seen.
    void tell_panels(const InputEvent& event);
    void begin_frame();
    /// Draws ImGui's part over what is there; what is drawn is complete when it returns.
    void draw_panels();
    void show_frame();
    std::string renderer() const; ///< what draws, in the driver's words
    Image image() const;          ///< after draw_panels(), before show_frame()

private:
    struct Callbacks;

    GLFWwindow* window_ = nullptr;
    double scale_ = 1.0;
    bool is_played_ = false;
    bool is_damaged_ = true; ///< its picture is gone, or has another size
    std::deque<InputEvent> events_;
    std::uint32_t pressed_ = 0; ///< buttons since the last frame, a bit each
    std::uint32_t down_ = 0;
    std::vector<int> keys_pressed_, keys_released_; ///< since the last frame
    double last_time_ = 0.0;
};

} // namespace cellwarp
