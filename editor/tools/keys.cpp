// SPDX-License-Identifier: GPL-3.0-or-later
// Mostly what Blender's users have in their fingers. Digits choose tools, as there are
// no modes to choose; with Alt they are a keypad for those who have none.
#include "editor/tools/keys.h"

#include <array>
#include <string_view>

namespace cellwarp::core
{

namespace
{

enum class Pad
{
    Either,
    On,  ///< of the keypad alone
    Off, ///< not of the keypad
};

struct Binding
{
    Command command;
    Key key;
    char character;
    Modifiers modifiers;
    Pad pad;
    // For the page of keys; no text: another row tells.
    std::string_view group, keys, does;
};

constexpr Modifiers kPlain{};
constexpr Modifiers kShift{.shift = true};
constexpr Modifiers kControl{.control = true};
constexpr Modifiers kAlt{.alt = true};
constexpr Modifiers kControlShift{.shift = true, .control = true};
constexpr Modifiers kControlAlt{.control = true, .alt = true};

constexpr std::string_view kTools = "Tools";
constexpr std::string_view kSelect = "Select";
constexpr std::string_view kRegions = "Regions";
constexpr std::string_view kView = "View";
constexpr std::string_view kHistory = "History";

constexpr Key kChar = Key::Character;

constexpr auto kBindings = std::to_array<Binding>({
    {Command::ToolClick, kChar, '1', kPlain, Pad::Off, kTools, "1",
     "click; drag for a box"},
    {Command::ToolBox, kChar, '2', kPlain, Pad::Off, kTools, "2 or B", "box"},
    {Command::ToolBox, kChar, 'b', kPlain, Pad::Off, "", "", ""},
    {Command::ToolLasso, kChar, '3', kPlain, Pad::Off, kTools, "3", "lasso"},
    {Command::ToolBrush, kChar, '4', kPlain, Pad::Off, kTools, "4 or C",
     "brush; wheel or [ ]: its radius"},
    {Command::ToolBrush, kChar, 'c', kPlain, Pad::Off, "", "", ""},
    {Command::ToolMove, kChar, '5', kPlain, Pad::Off, kTools, "5",
     "move; a handle can be dragged by itself"},
    {Command::ToolRotate, kChar, '6', kPlain, Pad::Off, kTools, "6", "rotate"},
    {Command::ToolDraw, kChar, '7', kPlain, Pad::Off, kTools, "7 or D",
     "draw a rod through the shape, click by click; Enter: done, Shift+Enter: as a "
     "curve"},
    {Command::ToolDraw, kChar, 'd', kPlain, Pad::Off, "", "", ""},
    {Command::BrushSmaller, kChar, '[', kPlain, Pad::Off, "", "", ""},
    {Command::BrushLarger, kChar, ']', kPlain, Pad::Off, "", "", ""},

    {Command::SelectAll, kChar, 'a', kPlain, Pad::Off, kSelect, "A", "all"},
    {Command::SelectNone, kChar, 'a', kAlt, Pad::Off, kSelect, "Alt+A", "nothing"},
    {Command::Invert, kChar, 'i', kControl, Pad::Off, kSelect, "I or Ctrl+I", "invert"},
    {Command::Invert, kChar, 'i', kPlain, Pad::Off, "", "", ""},
    {Command::Grow, kChar, '+', kPlain, Pad::Either, kSelect, "+ and -",
     "grow and shrink"},
    {Command::Grow, kChar, '+', kShift, Pad::Either, "", "", ""},
    {Command::Grow, kChar, '=', kPlain, Pad::Off, "", "", ""},
    {Command::Grow, kChar, '+', kControl, Pad::Either, "", "", ""},
    {Command::Shrink, kChar, '-', kPlain, Pad::Either, "", "", ""},
    {Command::Shrink, kChar, '-', kControl, Pad::Either, "", "", ""},
    {Command::AddConnected, kChar, 'l', kPlain, Pad::Off, kSelect, "L",
     "add what hangs together under the pointer"},
    {Command::RemoveConnected, kChar, 'l', kShift, Pad::Off, kSelect, "Shift+L",
     "take it out"},
    {Command::ExtendConnected, kChar, 'l', kControl, Pad::Off, kSelect, "Ctrl+L",
     "all that hangs together with the selection"},
    {Command::ToggleThrough, kChar, 'z', kAlt, Pad::Off, kSelect, "Alt+Z",
     "what is hidden too, or only what is seen"},

    {Command::MakeFixed, kChar, 'j', kPlain, Pad::Off, kRegions, "J",
     "fix what is selected"},
    {Command::MakeHandle, kChar, 'h', kPlain, Pad::Off, kRegions, "H",
     "make it a handle"},
    {Command::MakePin, kChar, 'p', kPlain, Pad::Off, kRegions, "P",
     "make it a pin, which turns freely"},
    {Command::MakeStiff, kChar, 'k', kPlain, Pad::Off, kRegions, "K", "make it stiff"},
    {Command::NextRegion, Key::Tab, 0, kPlain, Pad::Either, kRegions, "Tab",
     "next handle or pin"},
    {Command::RemoveRegion, Key::Delete, 0, kPlain, Pad::Either, kRegions, "Delete",
     "remove the active region, or point of a rod"},
    {Command::DrawCentreLine, kChar, 'd', kShift, Pad::Off, kRegions, "Shift+D",
     "rod along the middle of the limb that is selected"},
    {Command::InsertPoint, kChar, 'n', kShift, Pad::Off, kRegions, "Shift+N",
     "another point of the rod, behind the active one"},
    {Command::ReleasePoint, kChar, 'u', kPlain, Pad::Off, kRegions, "U",
     "let the active point of a rod go"},
    {Command::ReleaseDirection, kChar, 'u', kShift, Pad::Off, kRegions, "Shift+U",
     "let its direction and twist go, not its place"},
    {Command::Move, kChar, 'g', kPlain, Pad::Off, kRegions, "G",
     "move the active region"},
    {Command::Turn, kChar, 'r', kPlain, Pad::Off, kRegions, "R",
     "turn it; twice: freely"},
    {Command::PlacePivot, kChar, 'v', kPlain, Pad::Off, kRegions, "V",
     "what it turns about: to be put elsewhere, snaps to its border and middle"},
    {Command::PivotToBorder, kChar, 'v', kShift, Pad::Off, kRegions, "Shift+V",
     "it turns about its border"},

    {Command::FrameSelection, kChar, 'f', kPlain, Pad::Off, kView, "F or keypad .",
     "show the selection, or all"},
    {Command::FrameSelection, kChar, '.', kPlain, Pad::On, "", "", ""},
    {Command::FrameAll, Key::Home, 0, kPlain, Pad::Either, kView, "Home", "show all"},
    {Command::ViewFront, kChar, '1', kPlain, Pad::On, kView,
     "Keypad 1, 3, 7, or Alt and digit", "from the front, right, top; Ctrl: opposite"},
    {Command::ViewFront, kChar, '1', kAlt, Pad::Either, "", "", ""},
    {Command::ViewBack, kChar, '1', kControl, Pad::On, "", "", ""},
    {Command::ViewBack, kChar, '1', kControlAlt, Pad::Either, "", "", ""},
    {Command::ViewRight, kChar, '3', kPlain, Pad::On, "", "", ""},
    {Command::ViewRight, kChar, '3', kAlt, Pad::Either, "", "", ""},
    {Command::ViewLeft, kChar, '3', kControl, Pad::On, "", "", ""},
    {Command::ViewLeft, kChar, '3', kControlAlt, Pad::Either, "", "", ""},
    {Command::ViewTop, kChar, '7', kPlain, Pad::On, "", "", ""},
    {Command::ViewTop, kChar, '7', kAlt, Pad::Either, "", "", ""},
    {Command::ViewBottom, kChar, '7', kControl, Pad::On, "", "", ""},
    {Command::ViewBottom, kChar, '7', kControlAlt, Pad::Either, "", "", ""},
    {Command::TogglePerspective, kChar, '5', kPlain, Pad::On, kView, "Keypad 5 or Alt+5",
     "perspective or parallel"},
    {Command::TogglePerspective, kChar, '5', kAlt, Pad::Either, "", "", ""},
    {Command::OrbitLeft, Key::Left, 0, kPlain, Pad::Either, kView, "Arrows",
     "orbit by 15 degrees"},
    {Command::OrbitRight, Key::Right, 0, kPlain, Pad::Either, "", "", ""},
    {Command::OrbitUp, Key::Up, 0, kPlain, Pad::Either, "", "", ""},
    {Command::OrbitDown, Key::Down, 0, kPlain, Pad::Either, "", "", ""},
    {Command::OrbitDown, kChar, '2', kPlain, Pad::On, "", "", ""},
    {Command::OrbitLeft, kChar, '4', kPlain, Pad::On, "", "", ""},
    {Command::OrbitRight, kChar, '6', kPlain, Pad::On, "", "", ""},
    {Command::OrbitUp, kChar, '8', kPlain, Pad::On, "", "", ""},

    {Command::Undo, kChar, 'z', kControl, Pad::Off, kHistory, "Ctrl+Z", "undo"},
    {Command::Redo, kChar, 'y', kControl, Pad::Off, kHistory, "Ctrl+Y or Ctrl+Shift+Z",
     "redo"},
    {Command::Redo, kChar, 'z', kControlShift, Pad::Off, "", "", ""},
});

/// What is no single key of the table.
KeyHelp help(std::string_view group, std::string_view keys, std::string_view does)
{
    return {std::string(group), std::string(keys), std::string(does)};
}

} // namespace

std::optional<Command> command_of(const KeyEvent& event)
{
    for (const Binding& binding : kBindings)
        if (binding.key == event.key &&
            (binding.key != Key::Character || binding.character == event.character) &&
            binding.modifiers == event.modifiers &&
            (binding.pad == Pad::Either || (binding.pad == Pad::On) == event.is_keypad))
            return binding.command;
    return std::nullopt;
}

bool looks(Command command)
{
    return command >= Command::FrameSelection;
}

std::vector<KeyHelp> key_help(Navigation navigation)
{
    std::vector<KeyHelp> lines;
    std::string_view last;
    for (const Binding& binding : kBindings)
    {
        if (binding.keys.empty())
            continue;
        if (last == kSelect && binding.group != last)
            lines.push_back(help(kSelect, "Shift, Ctrl", "add, subtract"));
        if (last == kRegions && binding.group != last)
        {
            const std::string_view group = "While it is in the hand";
            lines.push_back(help(group, "X, Y, Z", "along, or about, that axis"));
            lines.push_back(help(group, "Shift+X, Y, Z", "in the plane across it"));
            lines.push_back(help(group, "a number", "instead of the pointer"));
            lines.push_back(help(group, "wheel, or R", "a point of a rod: twist it"));
            lines.push_back(help(group, "Ctrl", "in steps"));
            lines.push_back(help(group, "Enter or click", "done"));
            lines.push_back(help(group, "Esc or right click", "back"));
        }
        last = binding.group;
        lines.push_back(help(binding.group, binding.keys, binding.does));
    }
    const std::string_view group = "Look around";
    if (navigation == Navigation::Blender)
    {
        lines.push_back(help(group, "Middle or right drag, Alt+left", "orbit"));
        lines.push_back(help(group, "with Shift", "pan"));
        lines.push_back(help(group, "with Ctrl", "zoom"));
    }
    else
    {
        lines.push_back(help(group, "Alt+left drag", "orbit"));
        lines.push_back(help(group, "Alt+middle", "pan"));
        lines.push_back(help(group, "Alt+right", "zoom"));
    }
    lines.push_back(
        help(group, "Left drag beside it", "orbit, with the tools to move and rotate"));
    lines.push_back(help(group, "Wheel", "zoom to the pointer; Ctrl with the brush"));
    return lines;
}

} // namespace cellwarp::core
