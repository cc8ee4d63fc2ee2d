// SPDX-License-Identifier: GPL-3.0-or-later
// A window of the system with OpenGL and ImGui in it: events come out, frames go in. The
// one place that knows GLFW.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "editor/window/events.h"
#include "library/picture/image.h"

struct GLFWwindow;

namespace cellwarp::core
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

/// The character of a key: a digit by the key's place, others as the keyboard's layout
/// has it, and where the layout has no ASCII there (Cyrillic, Greek, a dead key) as the
/// US layout has it; in lower case. \p code: GLFW's number of the key, its US character;
/// \p on_layout: its name on the layout in UTF-8. 0: none.
char key_character(int code, std::string_view on_layout);

/// The event of a key by its name: "g", "?", "enter", "kp7", "f6"; none: there is no such
/// key.
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
    /// The next one that has not been taken, real or posted; false: there is none, or it
    /// waits for a frame that lets ImGui see what it was told before.
    bool take(InputEvent& event);
    /// Adds one at the end, as if the user had done it.
    void post(InputEvent event);
    /// Something happened that has not been drawn.
    bool has_news() const { return has_events() || is_damaged_; }
    bool has_events() const { return !events_.empty(); }

    int width() const; ///< [pixel of the screen]
    int height() const;
    double scale() const { return scale_; }
    bool wants_to_close() const;
    void keep_open();
    void set_title(const std::string& title);
    void resize(int width, int height);
    void set_dark(bool is_dark);

    /// Tells ImGui of an event that was taken.
    void tell_panels(const InputEvent& event);
    void begin_frame();
    /// Draws ImGui's part over what is there; what is drawn is complete when it returns.
    void draw_panels();
    void show_frame();
    std::string renderer() const; ///< what draws, in the driver's words
    Image image() const;          ///< after draw_panels(), before show_frame()

private:
    struct Callbacks;
    /// Changes since the last frame that ImGui has been told of.
    struct Told
    {
        bool button = false, wheel = false;
        bool key = false;       ///< one went down, Shift and its like aside
        bool named_key = false; ///< one without a character
    };

    bool fits_frame(const InputEvent& event) const;

    GLFWwindow* window_ = nullptr;
    double scale_ = 1.0;
    bool is_played_ = false;
    bool is_damaged_ = true; ///< its picture is gone, or has another size
    std::deque<InputEvent> events_;
    /// The place where the last motion left the pointer [pixel]; none: it has not moved
    /// yet, or the window has been moved since.
    std::optional<Eigen::Vector2d> pointer_;
    std::uint32_t down_ = 0; ///< buttons, a bit each
    Told told_;
    double last_time_ = 0.0;
};

} // namespace cellwarp::core
