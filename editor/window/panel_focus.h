// SPDX-License-Identifier: GPL-3.0-or-later
// Decides which keys and clicks belong to menus, panels and dialogs instead of the view.
// The window works without a mouse: F10 opens the menus, F6 goes from part to part.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "editor/window/events.h"

namespace cellwarp::core
{

class PanelFocus
{
public:
    bool is_typing() const; ///< a text field has the keyboard
    /// Keys move in the panels and press their controls, the view gets none.
    bool has_keys() const;
    /// A menu or a list is open that a click beside it closes.
    bool has_menu() const;
    /// A panel or menu lies over the view there [pixel of the screen].
    bool is_over(const Eigen::Vector2d& place) const;

    /// A button went down: menus that are not there close, and the press goes on to what
    /// lies under it. Keys go to the view again.
    void pressed(const Eigen::Vector2d& place);
    /// Moves the keyboard from part to part. True: the event was a key that does so.
    /// \p has_view: keys do something there; else Tab and the arrows go to a panel at
    /// once.
    bool take_key(const InputEvent& event, bool has_view);

    /// Before a frame begins. \p dialog: the number of the one that is open, 0: none.
    void prepare_frame(int dialog);
    /// Before and after the panels of that frame.
    void enter_wanted();
    void panels_shown();

    /// A menu or dialog has just been opened, and its first control does not have the
    /// keyboard yet; or a dialog has just been closed, and still has the input. Events
    /// have to wait. \p dialog: that is open now, as for prepare_frame().
    bool is_settling(int dialog) const
    {
        return frames_to_settle_ > 0 || wanted_menu_ || dialog != dialog_;
    }

    /// The menu of the menu bar to open in this frame: F10 asks for the first, and
    /// wish_menu() for another one.
    std::optional<int> take_menu_wish();
    void wish_menu(int menu) { wanted_menu_ = menu; }
    /// Called while a menu of the menu bar is shown. 1, -1: an arrow key goes on to the
    /// menu on its right, left; 0: it does not.
    int menu_step() const;

private:
    void go(int direction);
    void leave();

    bool is_inside_ = false;    ///< the keyboard is in a panel
    int part_ = 0;              ///< that has it
    std::optional<int> wanted_; ///< the part to enter in the next frame
    std::optional<int> wanted_menu_;
    int dialog_ = 0; ///< that was open in the last frame
    int frames_to_settle_ = 0;
    unsigned closed_menu_ = 0; ///< ImGui's number of the one that a press closed
};

} // namespace cellwarp::core
