// SPDX-License-Identifier: GPL-3.0-or-later
// What the user's hands do, as plain values that any window can make.
#pragma once

namespace cellwarp::core
{

enum class Button
{
    Left,
    Middle,
    Right
};

struct Modifiers
{
    bool shift = false, control = false, alt = false;

    bool operator==(const Modifiers&) const = default;
};

/// Keys by their names; those with a character as Character.
enum class Key
{
    Character,
    Enter,
    Escape,
    Tab,
    Backspace,
    Delete,
    Home,
    Space,
    Left,
    Right,
    Up,
    Down,
    F6,
    F10
};

struct KeyEvent
{
    Key key = Key::Character;
    char character = 0; ///< of Key::Character, in lower case: 'g', '7', '.', '-', '?'
    bool is_keypad = false;
    Modifiers modifiers;
};

enum class Tool
{
    Click,
    Box,
    Lasso,
    Brush,
    Move, ///< the gizmo; what it shows depends on the region
    Rotate,
    Draw ///< rods and curves, point by point
};

enum class Navigation
{
    Blender, ///< middle button: orbit; with Shift: pan; with Control: zoom
    Maya     ///< Alt with left, middle, right button: orbit, pan, zoom
};

} // namespace cellwarp::core
