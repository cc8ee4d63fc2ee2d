// SPDX-License-Identifier: GPL-3.0-or-later
// Menus, panels and dialogs by keys, and clicks beside menus.
#include "editor/window/panel_focus.h"

#include <filesystem>
#include <sstream>

#include "tests/editor/window/editor_window.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::Result;
using support::RunningEditor;

namespace
{

class PanelFocusWindow : public support::EditorWindow
{
protected:
    /// Plays statements on a bar seen from the front, and gives the regions of its handle
    /// file after them.
    std::string handles_after(const std::string& statements, const std::string& size = "")
    {
        const Result result = play((size.empty() ? "size 1200 800" : size) +
                                       "\nkey 1 alt\nkey home\nwait\n" + statements +
                                       "save " + file("saved.json") + "\n",
                                   {bar()});
        EXPECT_EQ(result.code, 0) << statements << result.err;
        std::string regions;
        std::istringstream lines(bytes_of(file("saved.handles")));
        for (std::string line; std::getline(lines, line);)
            if (!line.starts_with("cellwarp-handles") && !line.starts_with("#"))
                regions += line + "\n";
        return regions;
    }
};

/// A click on the name of the first menu, which opens it.
const std::string kOpenFile = "move 30 12\npress left\nrelease left\nframes 2\n";
const std::string kBox = "tool box\ndrag 0.99vw 0.2vh 0.8vw 0.8vh 4\n";

} // namespace

TEST_F(PanelFocusWindow, a_press_beside_a_menu_closes_it_and_does_what_it_was_meant_for)
{
    const std::string without = handles_after(kBox + "key j\n");
    ASSERT_TRUE(contains(without, "fixed ")) << without;
    EXPECT_EQ(handles_after(kOpenFile + kBox + "key j\n"), without);
    // However it was opened.
    EXPECT_EQ(handles_after("key f10\nframes 2\n" + kBox + "key j\n"), without);
    // A press on the menu itself is the menu's: Open... is there.
    const Result open =
        play(kOpenFile + "move 60 45\npress left\nrelease left\nframes 4\n" + kBox +
                 "key escape\nframes 2\nundo\n",
             {bar()});
    EXPECT_TRUE(contains(open.err, "there is nothing to undo")) << open.err;
}

TEST_F(PanelFocusWindow, a_click_on_the_name_of_an_open_menu_closes_it)
{
    // Then keys go to the view again.
    EXPECT_TRUE(
        contains(handles_after(kOpenFile + kOpenFile + "key a\nkey j\n"), "fixed "));
    EXPECT_EQ(handles_after(kOpenFile + "key a\nkey j\n"), "");
}

TEST_F(PanelFocusWindow, escape_closes_a_menu)
{
    EXPECT_TRUE(contains(
        handles_after(kOpenFile + "key escape\nframes 2\nkey a\nkey j\n"), "fixed "));
    EXPECT_TRUE(contains(handles_after("key f10\nkey escape\nkey a\nkey j\n"), "fixed "));
}

TEST_F(PanelFocusWindow, menus_are_reached_by_keys)
{
    // Edit > Undo, from File by the arrow to the right.
    EXPECT_EQ(handles_after("key a\nkey j\nkey f10\nkey right\nkey down\nkey enter\n"
                            "frames 2\n"),
              "");
    // From File to the left: Help, whose only line shows the keys.
    const std::string regions =
        handles_after("key f10\nkey left\nframes 3\nkey enter\nframes 4\n"
                      "key a\nkey j\nkey escape\nframes 2\nkey a\nkey k\n");
    EXPECT_TRUE(contains(regions, "stiff ")) << regions;
    EXPECT_FALSE(contains(regions, "fixed ")) << regions;
}

TEST_F(PanelFocusWindow, every_control_of_the_panel_is_reached_by_keys)
{
    // The headings of the model and of the regions, and the button that fixes.
    const std::string to_panel = "key a\nkey f6\nkey f6\nkey f6\nframes 3\n";
    EXPECT_TRUE(contains(
        handles_after(to_panel + "key tab\nkey tab\nkey enter\nframes 2\n"), "fixed "));
    EXPECT_TRUE(contains(
        handles_after(to_panel + "key tab\nkey tab\nkey tab\nkey space\nframes 2\n"),
        "handle "));
    // By arrows as well; Escape leads back to the view, where H is a shortcut.
    EXPECT_TRUE(contains(
        handles_after(to_panel + "key down\nkey down\nkey enter\nframes 2\n"), "fixed "));
    EXPECT_EQ(handles_after(to_panel + "key h\n"), "");
    EXPECT_TRUE(
        contains(handles_after(to_panel + "key escape\nframes 2\nkey h\n"), "handle "));
    // A tool of the column: the third one is the lasso, which is drawn by two sides.
    EXPECT_TRUE(contains(handles_after("key f6\nframes 3\nkey tab\nkey tab\nkey enter\n"
                                       "frames 2\nkey escape\nmove 0.05vw 0.2vh\n"
                                       "press left\nmove 0.2vw 0.2vh\nmove 0.2vw 0.8vh\n"
                                       "move 0.05vw 0.8vh\nrelease left\nwait\nkey j\n"),
                         "fixed "));
}

TEST_F(PanelFocusWindow, dialogs_are_answered_by_keys)
{
    const std::string edit = "key a\nkey j\n";
    const std::string lost = "undo\n"; // fails if nothing is open
    const auto ends = [&](const std::string& keys)
    { return play("wait\n" + edit + "key w ctrl\nframes 4\n" + keys + lost, {bar()}); };
    EXPECT_EQ(ends("key escape\nframes 2\n").code, 0);
    const Result left = ends("key right\nkey enter\nframes 4\n"); // Do not save
    EXPECT_TRUE(contains(left.err, "no file is open")) << left.err;
    // Save is the first answer; a name is asked for, and Enter takes it.
    const Result saved = ends("key enter\nframes 6\nkey enter\nframes 4\n");
    EXPECT_TRUE(contains(saved.err, "no file is open")) << saved.err;
    EXPECT_TRUE(contains(bytes_of(file("bar-edit.handles")), "fixed "));
    // A name that is typed at once, before the dialog has been drawn.
    const std::string name = "as-typed.json";
    std::filesystem::remove(file(name));
    EXPECT_EQ(play("wait\n" + edit + "key s ctrl\nkey a ctrl\ntext " + name +
                       "\nkey enter\nframes 3\n",
                   {bar()})
                  .code,
              0);
    EXPECT_TRUE(std::filesystem::exists(file(name)));
}

TEST_F(PanelFocusWindow, escape_leaves_the_question_of_recovery_for_the_next_time)
{
    {
        RunningEditor editor(*this, bar());
        if (!editor.is_there())
            GTEST_SKIP() << "xdotool is not installed";
        editor.type({"a", "j"});
        ASSERT_EQ(editor.edits(2).size(), 2u); // ends it by a kill
    }
    const std::string model = file("bar.obj");
    const Result put_off = play("frames 4\nkey escape\nframes 3\nundo\n", {model});
    EXPECT_TRUE(contains(put_off.err, "no file is open")) << put_off.err;
    const Result taken =
        play("frames 4\nkey enter\nframes 3\nsave " + file("back.json") + "\n", {model});
    EXPECT_EQ(taken.code, 0) << taken.err;
    EXPECT_TRUE(contains(bytes_of(file("back.handles")), "fixed "));
}

TEST_F(PanelFocusWindow, the_panel_is_hidden_by_n_and_dragged_by_its_edge)
{
    // A drag that ends where the panel was selects there once it is hidden.
    const std::string wide = "tool box\ndrag 900 300 1190 600 4\nkey j\n";
    const std::string with = handles_after(wide);
    EXPECT_TRUE(contains(handles_after("key n\n" + wide), "fixed "));
    EXPECT_EQ(handles_after("key n\nkey n\n" + wide), with);
    // 335 pixels of panel, of 1200; its edge goes to 1000.
    EXPECT_NE(handles_after("drag 862 400 1000 400 4\nkey home\n" + wide), with);
    // On a small screen with large letters the edge of the panel can be drawn to hide it.
    EXPECT_TRUE(
        contains(handles_after("drag 588 400 1022 400 4\nkey home\n" + kBox + "key j\n",
                               "size 1024 768"),
                 "fixed "));
}

} // namespace cellwarp::core
