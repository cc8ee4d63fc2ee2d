// SPDX-License-Identifier: GPL-3.0-or-later
// Which key does what. One table serves the hand and the page of keys that the window
// shows.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "editor/tools/events.h"

namespace cellwarp::core
{

enum class Command
{
    Move,
    Turn,
    PlacePivot,
    PivotToBorder,
    ToolClick,
    ToolBox,
    ToolLasso,
    ToolBrush,
    ToolMove,
    ToolRotate,
    ToolDraw,
    NextRegion,
    SelectAll,
    SelectNone,
    Invert,
    Grow,
    Shrink,
    AddConnected, ///< to what is under the pointer
    RemoveConnected,
    ExtendConnected, ///< the selection
    ToggleThrough,
    BrushSmaller,
    BrushLarger,
    MakeFixed,
    MakeHandle,
    MakePin,
    MakeStiff,
    RemoveRegion, ///< or the active point of a rod
    DrawCentreLine,
    InsertPoint, ///< behind the active one
    ReleasePoint,
    ReleaseDirection, ///< and twist; its place stays held
    Undo,
    Redo,
    FrameSelection,
    FrameAll,
    ViewFront,
    ViewBack,
    ViewRight,
    ViewLeft,
    ViewTop,
    ViewBottom,
    TogglePerspective,
    OrbitLeft,
    OrbitRight,
    OrbitUp,
    OrbitDown
};

/// What a key asks for while nothing is in the hand; none: nothing.
std::optional<Command> command_of(const KeyEvent& event);

/// Whether a command changes nothing but the view.
bool looks(Command command);

/// A line of the page of keys.
struct KeyHelp
{
    std::string group; ///< the same for lines that stand together
    std::string keys;
    std::string does;
};

/// All there is to know, for one way of looking around.
std::vector<KeyHelp> key_help(Navigation navigation);

} // namespace cellwarp::core
