// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/keys.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

std::optional<Command> typed(char character, const Modifiers& modifiers = {},
                             bool is_keypad = false)
{
    return command_of({Key::Character, character, is_keypad, modifiers});
}

constexpr Modifiers kShift{.shift = true};
constexpr Modifiers kControl{.control = true};
constexpr Modifiers kAlt{.alt = true};
constexpr Modifiers kControlShift{.shift = true, .control = true};
constexpr Modifiers kControlAlt{.control = true, .alt = true};

} // namespace

TEST(Keys, digits_choose_tools_and_on_the_keypad_or_with_alt_views)
{
    EXPECT_EQ(typed('1'), Command::ToolClick);
    EXPECT_EQ(typed('5'), Command::ToolMove);
    EXPECT_EQ(typed('1', {}, true), Command::ViewFront);
    EXPECT_EQ(typed('1', kControl, true), Command::ViewBack);
    EXPECT_EQ(typed('3', kAlt), Command::ViewRight);
    EXPECT_EQ(typed('3', kControlAlt), Command::ViewLeft);
    EXPECT_EQ(typed('7', {}, true), Command::ViewTop);
    EXPECT_EQ(typed('7', kControl, true), Command::ViewBottom);
    EXPECT_EQ(typed('5', {}, true), Command::TogglePerspective);
    EXPECT_EQ(typed('.', {}, true), Command::FrameSelection);
    EXPECT_FALSE(typed('.'));
}

TEST(Keys, modifiers_must_be_those_of_the_table)
{
    EXPECT_EQ(typed('z', kControl), Command::Undo);
    EXPECT_EQ(typed('z', kControlShift), Command::Redo);
    EXPECT_EQ(typed('y', kControl), Command::Redo);
    EXPECT_EQ(typed('z', kAlt), Command::ToggleThrough);
    EXPECT_FALSE(typed('z'));
    EXPECT_EQ(typed('a'), Command::SelectAll);
    EXPECT_EQ(typed('a', kAlt), Command::SelectNone);
    EXPECT_FALSE(typed('g', kControl));
    EXPECT_EQ(typed('+', kControl, true), Command::Grow);
    EXPECT_EQ(typed('-'), Command::Shrink);
    EXPECT_EQ(typed('l', kShift), Command::RemoveConnected);
    EXPECT_EQ(command_of({Key::Delete, 0, false, {}}), Command::RemoveRegion);
    EXPECT_FALSE(command_of({Key::Delete, 0, false, kShift}));
    EXPECT_FALSE(command_of({Key::Space, 'a', false, {}}));
}

TEST(Keys, the_page_of_keys_tells_of_every_group_and_of_the_buttons_in_use)
{
    for (const Navigation navigation : {Navigation::Blender, Navigation::Maya})
    {
        const std::vector<KeyHelp> lines = key_help(navigation);
        std::vector<std::string> groups;
        for (const KeyHelp& line : lines)
        {
            EXPECT_FALSE(line.keys.empty());
            EXPECT_FALSE(line.does.empty());
            if (groups.empty() || groups.back() != line.group)
                groups.push_back(line.group);
        }
        // Lines of a group stand together.
        EXPECT_EQ(groups, (std::vector<std::string>{"Tools", "Select", "Regions",
                                                    "While it is in the hand", "View",
                                                    "History", "Look around"}));
        EXPECT_EQ(std::count_if(lines.begin(), lines.end(),
                                [](const KeyHelp& line)
                                { return line.keys == "Alt+middle"; }),
                  navigation == Navigation::Maya ? 1 : 0);
    }
}

} // namespace cellwarp::core
