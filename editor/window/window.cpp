// SPDX-License-Identifier: GPL-3.0-or-later
// ImGui's own GLFW back end is not used: it asks GLFW for the pointer and the buttons,
// which a played event cannot change.
#include "editor/window/window.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include <Eigen/Core>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include "editor/window/gl.h"
#include "editor/window/style.h"
#include "io/base/error.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Longest time that ImGui is told to have passed: it animates nothing of ours [s].
constexpr double kLongestStep = 0.1;

std::string last_words; ///< of GLFW's last error

Modifiers modifiers_of(int mods)
{
    return {(mods & GLFW_MOD_SHIFT) != 0, (mods & GLFW_MOD_CONTROL) != 0,
            (mods & GLFW_MOD_ALT) != 0};
}

/// Keys that are not known by their character.
bool named_key(int code, KeyEvent& event)
{
    switch (code)
    {
    case GLFW_KEY_KP_ENTER:
        event.is_keypad = true;
        [[fallthrough]];
    case GLFW_KEY_ENTER:
        event.key = Key::Enter;
        return true;
    case GLFW_KEY_ESCAPE:
        event.key = Key::Escape;
        return true;
    case GLFW_KEY_TAB:
        event.key = Key::Tab;
        return true;
    case GLFW_KEY_BACKSPACE:
        event.key = Key::Backspace;
        return true;
    case GLFW_KEY_DELETE:
        event.key = Key::Delete;
        return true;
    case GLFW_KEY_HOME:
        event.key = Key::Home;
        return true;
    case GLFW_KEY_SPACE:
        event.key = Key::Space;
        return true;
    case GLFW_KEY_LEFT:
        event.key = Key::Left;
        return true;
    case GLFW_KEY_RIGHT:
        event.key = Key::Right;
        return true;
    case GLFW_KEY_UP:
        event.key = Key::Up;
        return true;
    case GLFW_KEY_DOWN:
        event.key = Key::Down;
        return true;
    case GLFW_KEY_F6:
        event.key = Key::F6;
        return true;
    case GLFW_KEY_F10:
        event.key = Key::F10;
        return true;
    default:
        return false;
    }
}

/// The character of a key, in lower case; 0: the key has none that tools know.
char character_of(int code, int scancode, bool& is_keypad)
{
    constexpr std::string_view kKeypad = "0123456789./*-+";
    if (code >= GLFW_KEY_KP_0 && code <= GLFW_KEY_KP_ADD)
    {
        is_keypad = true;
        return kKeypad[idx(code - GLFW_KEY_KP_0)];
    }
    const char* const name = glfwGetKeyName(code, scancode);
    return key_character(code, name == nullptr ? "" : name);
}

/// ImGui's number of a key. A letter counts by its character: Ctrl+Z is undo in a text
/// field on every layout.
int panel_code(const InputEvent& event)
{
    const auto character = static_cast<unsigned char>(event.key.character);
    return event.key.key == Key::Character && std::isalpha(character) != 0
               ? std::toupper(character)
               : event.code;
}

void prepare_panels()
{
    ImGui::CreateContext();
    ImGuiIO& io = ImGui::GetIO();
    io.IniFilename = nullptr; // panels stand where they stand
    constexpr std::array<std::pair<int, int>, 22> kKeys = {
        {{ImGuiKey_Tab, GLFW_KEY_TAB},
         {ImGuiKey_LeftArrow, GLFW_KEY_LEFT},
         {ImGuiKey_RightArrow, GLFW_KEY_RIGHT},
         {ImGuiKey_UpArrow, GLFW_KEY_UP},
         {ImGuiKey_DownArrow, GLFW_KEY_DOWN},
         {ImGuiKey_PageUp, GLFW_KEY_PAGE_UP},
         {ImGuiKey_PageDown, GLFW_KEY_PAGE_DOWN},
         {ImGuiKey_Home, GLFW_KEY_HOME},
         {ImGuiKey_End, GLFW_KEY_END},
         {ImGuiKey_Insert, GLFW_KEY_INSERT},
         {ImGuiKey_Delete, GLFW_KEY_DELETE},
         {ImGuiKey_Backspace, GLFW_KEY_BACKSPACE},
         {ImGuiKey_Space, GLFW_KEY_SPACE},
         {ImGuiKey_Enter, GLFW_KEY_ENTER},
         {ImGuiKey_Escape, GLFW_KEY_ESCAPE},
         {ImGuiKey_KeyPadEnter, GLFW_KEY_KP_ENTER},
         {ImGuiKey_A, GLFW_KEY_A},
         {ImGuiKey_C, GLFW_KEY_C},
         {ImGuiKey_V, GLFW_KEY_V},
         {ImGuiKey_X, GLFW_KEY_X},
         {ImGuiKey_Y, GLFW_KEY_Y},
         {ImGuiKey_Z, GLFW_KEY_Z}}};
    for (const auto& [theirs, ours] : kKeys)
        io.KeyMap[theirs] = ours;
    io.SetClipboardTextFn = [](void* window, const char* text)
    { glfwSetClipboardString(static_cast<GLFWwindow*>(window), text); };
    io.GetClipboardTextFn = [](void* window)
    { return glfwGetClipboardString(static_cast<GLFWwindow*>(window)); };
}

[[noreturn]] void no_display()
{
    const std::string words = last_words.empty() ? "" : " (" + last_words + ")";
    glfwTerminate();
    throw Error(Fault::Usage,
                "the editor needs a display with OpenGL 3.3, and there is none" + words +
                    "; cellwarp deform, render and apply work without one");
}

double scale_of(const WindowOptions& options, float of_display)
{
    return options.scale > 0.0 ? options.scale : std::max(1.0f, of_display);
}

/// Of the window at first [pixel of the screen].
Eigen::Vector2i first_size(const WindowOptions& options)
{
    const Eigen::Vector2i wanted(options.width, options.height);
    GLFWmonitor* const monitor = glfwGetPrimaryMonitor();
    if (options.is_played || monitor == nullptr)
        return wanted;
    float across = 1.0f, down = 1.0f;
    glfwGetMonitorContentScale(monitor, &across, &down);
    int x = 0, y = 0;
    Eigen::Vector2i room = Eigen::Vector2i::Zero();
    glfwGetMonitorWorkarea(monitor, &x, &y, &room.x(), &room.y());
    return size_within(wanted, scale_of(options, across), room);
}

} // namespace

struct Window::Callbacks
{
    static Window& self(GLFWwindow* window)
    {
        return *static_cast<Window*>(glfwGetWindowUserPointer(window));
    }

    static void from_display(GLFWwindow* window, InputEvent event)
    {
        if (!self(window).is_played_)
            self(window).post(std::move(event));
    }

    /// GLFW counts in its own units; pixels are what we draw.
    static Eigen::Vector2d to_pixels(GLFWwindow* window, double x, double y)
    {
        int wide = 0, high = 0, columns = 0, rows = 0;
        glfwGetWindowSize(window, &wide, &high);
        glfwGetFramebufferSize(window, &columns, &rows);
        return {x * columns / std::max(wide, 1), y * rows / std::max(high, 1)};
    }

    static Modifiers held(GLFWwindow* window)
    {
        const auto is_down = [&](int left, int right)
        {
            return glfwGetKey(window, left) == GLFW_PRESS ||
                   glfwGetKey(window, right) == GLFW_PRESS;
        };
        return {is_down(GLFW_KEY_LEFT_SHIFT, GLFW_KEY_RIGHT_SHIFT),
                is_down(GLFW_KEY_LEFT_CONTROL, GLFW_KEY_RIGHT_CONTROL),
                is_down(GLFW_KEY_LEFT_ALT, GLFW_KEY_RIGHT_ALT)};
    }

    static void moved(GLFWwindow* window, double x, double y)
    {
        const Eigen::Vector2d place = to_pixels(window, x, y);
        self(window).pointer_ = place;
        from_display(
            window,
            {.kind = InputEvent::Kind::Move, .place = place, .modifiers = held(window)});
    }

    /// Place of the pointer when the event happened: that of the last motion before it,
    /// as events come in their order. glfwGetCursorPos asks the display where the pointer
    /// is now, which is elsewhere if frames are slow.
    static Eigen::Vector2d pointer(GLFWwindow* window)
    {
        if (const std::optional<Eigen::Vector2d>& known = self(window).pointer_)
            return *known;
        double x = 0.0, y = 0.0;
        glfwGetCursorPos(window, &x, &y);
        return to_pixels(window, x, y);
    }

    static void button(GLFWwindow* window, int button, int action, int mods)
    {
        if (button > GLFW_MOUSE_BUTTON_MIDDLE)
            return;
        InputEvent event;
        event.kind =
            action == GLFW_PRESS ? InputEvent::Kind::Press : InputEvent::Kind::Release;
        event.place = pointer(window);
        event.button = button == GLFW_MOUSE_BUTTON_LEFT    ? Button::Left
                       : button == GLFW_MOUSE_BUTTON_RIGHT ? Button::Right
                                                           : Button::Middle;
        event.modifiers = modifiers_of(mods);
        from_display(window, event);
    }

    static void scrolled(GLFWwindow* window, double x, double y)
    {
        from_display(window, {.kind = InputEvent::Kind::Wheel,
                              .place = {x, y},
                              .modifiers = held(window)});
    }

    static void key(GLFWwindow* window, int code, int scancode, int action, int mods)
    {
        InputEvent event;
        event.kind =
            action == GLFW_RELEASE ? InputEvent::Kind::KeyUp : InputEvent::Kind::KeyDown;
        event.code = code;
        event.is_repeated = action == GLFW_REPEAT;
        event.modifiers = event.key.modifiers = modifiers_of(mods);
        if (!named_key(code, event.key))
        {
            const char character = character_of(code, scancode, event.key.is_keypad);
            // The text event that follows has the character that Shift makes of a key
            // without a letter, and AltGr of any key.
            const bool is_altgr = glfwGetKey(window, GLFW_KEY_RIGHT_ALT) == GLFW_PRESS &&
                                  !event.modifiers.alt;
            const bool is_text =
                is_altgr || (event.modifiers.shift && !event.modifiers.control &&
                             std::isalpha(static_cast<unsigned char>(character)) == 0);
            event.key.character = is_text ? char(0) : character;
        }
        from_display(window, event);
    }

    static void text(GLFWwindow* window, unsigned character)
    {
        InputEvent event;
        event.kind = InputEvent::Kind::Text;
        event.character = character;
        event.modifiers = held(window);
        from_display(window, event);
    }

    static void focus(GLFWwindow* window, int has_it)
    {
        if (has_it == GLFW_FALSE)
            from_display(window, {.kind = InputEvent::Kind::FocusLost});
    }

    /// The window goes from under the pointer, which tells of no motion.
    static void shifted(GLFWwindow* window, int, int) { self(window).pointer_.reset(); }

    static void damaged(GLFWwindow* window) { self(window).is_damaged_ = true; }

    static void drop(GLFWwindow* window, int count, const char** paths)
    {
        InputEvent event;
        event.kind = InputEvent::Kind::Drop;
        event.paths.assign(paths, paths + count);
        from_display(window, event);
    }
};

char key_character(int code, std::string_view on_layout)
{
    if (code >= GLFW_KEY_0 && code <= GLFW_KEY_9)
        return static_cast<char>(code);
    const bool is_ascii =
        on_layout.size() == 1 && on_layout[0] > ' ' && on_layout[0] < 127;
    const int character = is_ascii                                      ? on_layout[0]
                          : code > ' ' && code <= GLFW_KEY_GRAVE_ACCENT ? code
                                                                        : 0;
    return static_cast<char>(std::tolower(character));
}

std::optional<InputEvent> key_press(const std::string& name, const Modifiers& modifiers)
{
    constexpr std::array<std::pair<std::string_view, int>, 16> kNames = {
        {{"enter", GLFW_KEY_ENTER},
         {"escape", GLFW_KEY_ESCAPE},
         {"tab", GLFW_KEY_TAB},
         {"backspace", GLFW_KEY_BACKSPACE},
         {"delete", GLFW_KEY_DELETE},
         {"home", GLFW_KEY_HOME},
         {"end", GLFW_KEY_END},
         {"space", GLFW_KEY_SPACE},
         {"left", GLFW_KEY_LEFT},
         {"right", GLFW_KEY_RIGHT},
         {"up", GLFW_KEY_UP},
         {"down", GLFW_KEY_DOWN},
         {"pageup", GLFW_KEY_PAGE_UP},
         {"pagedown", GLFW_KEY_PAGE_DOWN},
         {"f6", GLFW_KEY_F6},
         {"f10", GLFW_KEY_F10}}};
    InputEvent event;
    event.kind = InputEvent::Kind::KeyDown;
    event.modifiers = event.key.modifiers = modifiers;
    if (name.size() == 1 && name[0] > 32 && name[0] < 127)
    {
        event.key.character = name[0];
        // GLFW numbers keys by the capital that stands on them.
        event.code = std::toupper(static_cast<unsigned char>(name[0]));
        return event;
    }
    if (name.size() == 3 && name.starts_with("kp") && name[2] >= '0' && name[2] <= '9')
    {
        event.key.character = name[2];
        event.key.is_keypad = true;
        event.code = GLFW_KEY_KP_0 + (name[2] - '0');
        return event;
    }
    for (const auto& [known, code] : kNames)
        if (name == known)
        {
            event.code = code;
            named_key(code, event.key);
            return event;
        }
    return std::nullopt;
}

Eigen::Vector2i size_within(const Eigen::Vector2i& wanted, double scale,
                            const Eigen::Vector2i& room)
{
    constexpr double kTitle = 32.0; // the bar above the window, in the editor's pixels
    const Eigen::Vector2i size = (scale * wanted.cast<double>()).cast<int>();
    const Eigen::Vector2i most(room.x(), room.y() - static_cast<int>(kTitle * scale));
    return (most.array() > 0).all() ? Eigen::Vector2i(size.cwiseMin(most)) : size;
}

Window::Window(const WindowOptions& options) : is_played_(options.is_played)
{
    last_words.clear();
    glfwSetErrorCallback([](int, const char* words) { last_words = words; });
    if (!glfwInit())
        no_display();
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    glfwWindowHint(GLFW_FOCUS_ON_SHOW, GLFW_TRUE);
    const Eigen::Vector2i size = first_size(options);
    window_ = glfwCreateWindow(size.x(), size.y(), "cellwarp", nullptr, nullptr);
    if (window_ == nullptr)
        no_display();
    glfwMakeContextCurrent(window_);
    glfwSwapInterval(options.is_played ? 0 : 1);
    float across = 1.0f, down = 1.0f;
    glfwGetWindowContentScale(window_, &across, &down);
    scale_ = scale_of(options, across);
    glfwSetWindowUserPointer(window_, this);
    glfwSetCursorPosCallback(window_, Callbacks::moved);
    glfwSetMouseButtonCallback(window_, Callbacks::button);
    glfwSetScrollCallback(window_, Callbacks::scrolled);
    glfwSetKeyCallback(window_, Callbacks::key);
    glfwSetCharCallback(window_, Callbacks::text);
    glfwSetWindowFocusCallback(window_, Callbacks::focus);
    glfwSetDropCallback(window_, Callbacks::drop);
    glfwSetWindowRefreshCallback(window_, Callbacks::damaged);
    glfwSetWindowPosCallback(window_, Callbacks::shifted);
    glfwSetFramebufferSizeCallback(window_, [](GLFWwindow* window, int, int)
                                   { Callbacks::damaged(window); });
    prepare_panels();
    ImGui::GetIO().ClipboardUserData = window_;
    load_fonts(static_cast<float>(scale_));
    apply_style(options.is_dark, static_cast<float>(scale_));
    ImGui_ImplOpenGL3_Init("#version 330 core");
    last_time_ = glfwGetTime();
}

Window::~Window()
{
    ImGui_ImplOpenGL3_Shutdown();
    ImGui::DestroyContext();
    glfwDestroyWindow(window_);
    glfwTerminate();
}

void Window::wait(double seconds)
{
    if (seconds > 0.0 && !has_news())
        glfwWaitEventsTimeout(seconds);
    else
        glfwPollEvents();
}

bool Window::take(InputEvent& event)
{
    if (events_.empty() || !fits_frame(events_.front()))
        return false;
    event = std::move(events_.front());
    events_.pop_front();
    return true;
}

void Window::post(InputEvent event)
{
    events_.push_back(std::move(event));
}

int Window::width() const
{
    int wide = 0, high = 0;
    glfwGetFramebufferSize(window_, &wide, &high);
    return wide;
}

int Window::height() const
{
    int wide = 0, high = 0;
    glfwGetFramebufferSize(window_, &wide, &high);
    return high;
}

bool Window::wants_to_close() const
{
    return glfwWindowShouldClose(window_) != 0;
}
void Window::keep_open()
{
    glfwSetWindowShouldClose(window_, GLFW_FALSE);
}

void Window::set_title(const std::string& title)
{
    glfwSetWindowTitle(window_, title.c_str());
}

void Window::resize(int width, int height)
{
    glfwSetWindowSize(window_, width, height);
    // The display answers later; a script goes on when it has.
    for (int k = 0; k < 200 && (this->width() != width || this->height() != height); ++k)
        glfwWaitEventsTimeout(0.01);
}

void Window::set_dark(bool is_dark)
{
    apply_style(is_dark, static_cast<float>(scale_));
}

/// ImGui sees a state once a frame, not events: a press would be where the pointer went
/// to afterwards, two presses would be one, a shortcut would be without its Ctrl, and
/// text would not be in the field that was clicked. The view takes events as they come,
/// so further keys wait only while panels have the keyboard: a key held down in the view
/// leaves no queue behind.
bool Window::fits_frame(const InputEvent& event) const
{
    const bool types = ImGui::GetIO().WantCaptureKeyboard;
    switch (event.kind)
    {
    case InputEvent::Kind::Move:
    case InputEvent::Kind::Press:
    case InputEvent::Kind::Release:
        return !told_.button && !told_.wheel;
    case InputEvent::Kind::KeyDown:
        return !told_.button && (!types || event.is_repeated || !told_.key);
    case InputEvent::Kind::KeyUp:
        return !types || !told_.key;
    case InputEvent::Kind::Text:
        return !told_.button && (!types || !told_.named_key);
    case InputEvent::Kind::Wheel:
    case InputEvent::Kind::FocusLost:
    case InputEvent::Kind::Drop:
        return true;
    }
    return true;
}

void Window::tell_panels(const InputEvent& event)
{
    ImGuiIO& io = ImGui::GetIO();
    io.KeyShift = event.modifiers.shift;
    io.KeyCtrl = event.modifiers.control;
    io.KeyAlt = event.modifiers.alt;
    const auto place =
        ImVec2(static_cast<float>(event.place.x()), static_cast<float>(event.place.y()));
    // ImGui's order is left, right, middle.
    const std::uint32_t bit = event.button == Button::Left    ? 1u
                              : event.button == Button::Right ? 2u
                                                              : 4u;
    const int code = panel_code(event);
    switch (event.kind)
    {
    case InputEvent::Kind::Move:
        io.MousePos = place;
        break;
    case InputEvent::Kind::Press:
        io.MousePos = place;
        down_ |= bit;
        told_.button = true;
        break;
    case InputEvent::Kind::Release:
        io.MousePos = place;
        down_ &= ~bit;
        told_.button = true;
        break;
    case InputEvent::Kind::Wheel:
        io.MouseWheelH += place.x;
        io.MouseWheel += place.y;
        told_.wheel = io.WantCaptureMouse;
        break;
    case InputEvent::Kind::KeyDown:
        if (code > 0 && code < 512)
            io.KeysDown[code] = true;
        if (code < GLFW_KEY_LEFT_SHIFT || code > GLFW_KEY_RIGHT_SUPER)
        {
            told_.key = true;
            told_.named_key |= event.key.key != Key::Character;
        }
        break;
    case InputEvent::Kind::KeyUp:
        if (code > 0 && code < 512)
            io.KeysDown[code] = false;
        break;
    case InputEvent::Kind::Text:
        io.AddInputCharacter(event.character);
        break;
    case InputEvent::Kind::FocusLost:
        std::fill(std::begin(io.KeysDown), std::end(io.KeysDown), false);
        down_ = 0;
        break;
    case InputEvent::Kind::Drop:
        break;
    }
}

void Window::begin_frame()
{
    is_damaged_ = false;
    ImGuiIO& io = ImGui::GetIO();
    for (std::uint32_t k = 0; k < 3; ++k)
        io.MouseDown[k] = ((down_ >> k) & 1u) != 0;
    told_ = {};
    io.DisplaySize = {static_cast<float>(width()), static_cast<float>(height())};
    const double now = glfwGetTime();
    io.DeltaTime = static_cast<float>(std::clamp(now - last_time_, 1e-4, kLongestStep));
    last_time_ = now;
    ImGui_ImplOpenGL3_NewFrame();
    ImGui::NewFrame();
}

void Window::draw_panels()
{
    ImGui::Render();
    glViewport(0, 0, width(), height());
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
    glFinish();
}

void Window::show_frame()
{
    glfwSwapBuffers(window_);
}

std::string Window::renderer() const
{
    return reinterpret_cast<const char*>(glGetString(GL_RENDERER));
}

Image Window::image() const
{
    Image image;
    image.width = width();
    image.height = height();
    const std::size_t row = 3 * idx(image.width);
    image.rgb.resize(row * idx(image.height));
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, image.width, image.height, GL_RGB, GL_UNSIGNED_BYTE,
                 image.rgb.data());
    for (int y = 0; y < image.height / 2; ++y) // OpenGL counts rows from below
        std::swap_ranges(image.rgb.begin() + static_cast<std::ptrdiff_t>(row) * y,
                         image.rgb.begin() + static_cast<std::ptrdiff_t>(row) * (y + 1),
                         image.rgb.begin() +
                             static_cast<std::ptrdiff_t>(row) * (image.height - 1 - y));
    return image;
}

} // namespace cellwarp::core
