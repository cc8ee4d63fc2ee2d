// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/panel_focus.h"

#include <array>
#include <utility>

#include <imgui.h>
#include <imgui_internal.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Parts that F6 goes through, by the names of their windows.
constexpr std::array<const char*, 5> kParts = {"tools", "options", "panels", "film",
                                               "welcome"};

/// ImGui gives a text field the keyboard in the third frame of its dialog.
constexpr int kFramesToSettle = 4;
/// And takes a dialog that is closed for a popup until the second frame.
constexpr int kFramesToClose = 2;

ImGuiWindow* window_of(int part)
{
    ImGuiWindow* const window = ImGui::FindWindowByName(kParts[idx(part)]);
    const bool is_shown = window != nullptr && (window->Active || window->WasActive);
    return is_shown && !window->Hidden ? window : nullptr;
}

bool is_menu_over(const ImVec2& place)
{
    const ImGuiContext& g = *ImGui::GetCurrentContext();
    for (const ImGuiPopupData& popup : g.OpenPopupStack)
        if (popup.Window != nullptr && popup.Window->Rect().Contains(place))
            return true;
    return false;
}

/// Marks the control that keys act on.
void mark_control()
{
    ImGuiContext& g = *ImGui::GetCurrentContext();
    g.NavDisableHighlight = false;
    g.NavDisableMouseHover = true;
}

ImVec2 point(const Eigen::Vector2d& place)
{
    return {static_cast<float>(place.x()), static_cast<float>(place.y())};
}

} // namespace

bool PanelFocus::has_menu() const
{
    const ImGuiContext& g = *ImGui::GetCurrentContext();
    return !g.OpenPopupStack.empty() && ImGui::GetTopMostPopupModal() == nullptr;
}

bool PanelFocus::is_typing() const
{
    // WantTextInput is of the frame before, and a key that follows Escape is not text.
    const ImGuiContext& g = *ImGui::GetCurrentContext();
    return g.ActiveId != 0 && ImGui::GetInputTextState(g.ActiveId) != nullptr;
}

bool PanelFocus::has_keys() const
{
    return is_inside_ || has_menu() || is_typing();
}

bool PanelFocus::is_over(const Eigen::Vector2d& place) const
{
    const ImGuiContext& g = *ImGui::GetCurrentContext();
    for (const ImGuiWindow* window : g.Windows)
        if (window->Active && !window->Hidden &&
            (window->Flags & ImGuiWindowFlags_NoMouseInputs) == 0 &&
            window->OuterRectClipped.Contains(point(place)))
            return true;
    return false;
}

void PanelFocus::pressed(const Eigen::Vector2d& place)
{
    closed_menu_ = 0;
    if (has_menu() && !is_menu_over(point(place)))
    {
        closed_menu_ = ImGui::GetCurrentContext()->OpenPopupStack.front().PopupId;
        ImGui::ClosePopupToLevel(0, false);
        ImGui::FocusWindow(nullptr);
    }
    is_inside_ = false;
}

void PanelFocus::go(int direction)
{
    const int count = static_cast<int>(kParts.size());
    int next = is_inside_ ? part_ + direction : direction > 0 ? 0 : count - 1;
    while (next >= 0 && next < count && window_of(next) == nullptr)
        next += direction;
    if (next < 0 || next >= count)
        return leave();
    is_inside_ = true;
    wanted_ = part_ = next;
}

void PanelFocus::leave()
{
    is_inside_ = false;
    ImGui::ClearActiveID();
    ImGui::FocusWindow(nullptr);
}

bool PanelFocus::take_key(const InputEvent& event, bool has_view)
{
    if (event.kind != InputEvent::Kind::KeyDown)
        return false;
    switch (event.key.key)
    {
    case Key::F6:
        if (!has_menu())
            go(event.modifiers.shift ? -1 : 1);
        return true;
    case Key::F10:
        if (!has_menu())
            wanted_menu_ = 0;
        return true;
    case Key::Tab:
        if (event.modifiers.control)
        {
            if (!has_menu())
                go(event.modifiers.shift ? -1 : 1);
            return true;
        }
        // From a text field it goes on to controls that are none.
        is_inside_ = is_inside_ || is_typing();
        [[fallthrough]];
    case Key::Down:
        if (has_view || has_keys())
            return false;
        go(1);
        return true;
    case Key::Escape:
        if (!is_inside_ || has_menu() || ImGui::GetCurrentContext()->ActiveId != 0)
            return false;
        leave();
        return true;
    default:
        return false;
    }
}

std::optional<int> PanelFocus::take_menu_wish()
{
    if (wanted_menu_)
        frames_to_settle_ = kFramesToSettle;
    return std::exchange(wanted_menu_, std::nullopt);
}

int PanelFocus::menu_step() const
{
    const ImGuiContext& g = *ImGui::GetCurrentContext();
    const bool is_sideways =
        g.NavMoveDir == ImGuiDir_Left || g.NavMoveDir == ImGuiDir_Right;
    // The move would have gone on into a list of the menu, or out of one.
    if (!is_sideways || g.OpenPopupStack.Size != 1 ||
        !ImGui::NavMoveRequestButNoResultYet())
        return 0;
    ImGui::NavMoveRequestCancel();
    return g.NavMoveDir == ImGuiDir_Right ? 1 : -1;
}

void PanelFocus::prepare_frame(int dialog)
{
    ImGuiContext& g = *ImGui::GetCurrentContext();
    ImGuiIO& io = g.IO;
    const bool navigates = is_inside_ || has_menu() || dialog != 0 || wanted_menu_;
    if (navigates)
        io.ConfigFlags |= ImGuiConfigFlags_NavEnableKeyboard;
    else
        io.ConfigFlags &= ~ImGuiConfigFlags_NavEnableKeyboard;
    if (dialog != dialog_)
        frames_to_settle_ = dialog != 0 ? kFramesToSettle : kFramesToClose;
    dialog_ = dialog;
    // ImGui presses with the space bar alone.
    if (navigates && (io.KeysDown[io.KeyMap[ImGuiKey_Enter]] ||
                      io.KeysDown[io.KeyMap[ImGuiKey_KeyPadEnter]]))
        io.NavInputs[ImGuiNavInput_Activate] = 1.0f;
}

void PanelFocus::enter_wanted()
{
    if (is_inside_ && window_of(part_) == nullptr && !wanted_)
        leave(); // it has been hidden
    ImGuiContext& g = *ImGui::GetCurrentContext();
    if (frames_to_settle_ > 0)
    {
        --frames_to_settle_;
        if (dialog_ != 0 || has_menu() || is_inside_)
            mark_control();
        // A menu that takes the place of another one has no first item yet.
        const bool is_popup =
            g.NavWindow != nullptr && (g.NavWindow->Flags & ImGuiWindowFlags_Popup) != 0;
        if (frames_to_settle_ == 1 && is_popup && g.NavId == 0)
            ImGui::NavInitWindow(g.NavWindow, true);
    }
    // ImGui's Tab goes on from a text field alone, and else begins anew.
    if (g.NavMoveSubmitted && (g.NavMoveFlags & ImGuiNavMoveFlags_Tabbing) != 0 &&
        g.NavTabbingDir == 0 && g.NavId != 0)
        g.NavTabbingDir = 1;
    if (!wanted_)
        return;
    ImGuiWindow* const window = window_of(*std::exchange(wanted_, std::nullopt));
    if (window == nullptr)
        return leave();
    ImGui::ClearActiveID();
    ImGui::FocusWindow(window);
    ImGui::NavInitWindow(window, true);
    frames_to_settle_ = kFramesToSettle;
    mark_control();
}

void PanelFocus::panels_shown()
{
    ImGuiContext& g = *ImGui::GetCurrentContext();
    if (closed_menu_ == 0)
        return;
    // The click on the name of an open menu closes it and does not open it again.
    if (!g.OpenPopupStack.empty() && g.OpenPopupStack.front().PopupId == closed_menu_)
        ImGui::ClosePopupToLevel(0, false);
    bool is_down = false;
    for (const bool button : g.IO.MouseDown)
        is_down |= button;
    if (!is_down)
        closed_menu_ = 0;
}

} // namespace cellwarp::core
