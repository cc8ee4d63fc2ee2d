// SPDX-License-Identifier: GPL-3.0-or-later
// What the user does to the window, as values: real events and played ones are the same.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/tools/interaction.h"

namespace cellwarp::core
{

struct InputEvent
{
    enum class Kind
    {
        Move,
        Press,
        Release,
        Wheel,
        KeyDown,
        KeyUp,
        Text,
        FocusLost,
        Drop
    };
    Kind kind = Kind::Move;
    Eigen::Vector2d place = Eigen::Vector2d::Zero(); ///< [pixel]; of Wheel: steps
    Button button = Button::Left;
    Modifiers modifiers = {};
    int code = 0;             ///< GLFW's number of the key; 0: it has none
    KeyEvent key = {};        ///< character 0: the key writes nothing that is known
    bool is_repeated = false; ///< the key is held down
    unsigned character = 0;   ///< of Text
    std::vector<std::string> paths = {}; ///< of Drop
};

} // namespace cellwarp::core
