// SPDX-License-Identifier: GPL-3.0-or-later
// The editor as a user starts it: the real window, on a display of the test's own.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include <signal.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "editor/document/document.h"
#include "octree/base/index.h"
#include "tests/editor/window/editor_window.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::EditorWindow;
using support::Result;
using support::RunningEditor;

namespace
{

/// What the editor shows in one colour.
struct Spot
{
    int pixels = 0;
    double x = 0.0, y = 0.0; ///< their middle
};

struct Picture
{
    static constexpr int kTools = 70; ///< their column, and a margin [pixel]
    int width = 0, height = 0;
    std::string rgb;

    explicit Picture(const std::string& path)
    {
        const std::string bytes = bytes_of(path);
        std::istringstream head(bytes);
        std::string kind;
        int most = 0;
        head >> kind >> width >> height >> most;
        EXPECT_EQ(kind, "P6") << path;
        if (kind == "P6")
            rgb = bytes.substr(static_cast<std::size_t>(head.tellg()) + 1);
        EXPECT_EQ(rgb.size(), 3u * idx(width * height));
    }

    /// The view alone.
    std::string view() const
    {
        std::string pixels;
        for (int y = height / 10; y < height * 8 / 10; ++y)
            pixels += rgb.substr(3 * idx(y * width + kTools), 3 * idx(width * 6 / 10));
        return pixels;
    }

    /// All but the status bar, which tells how long frames take.
    std::string without_times() const { return rgb.substr(0, rgb.size() / 10 * 9); }

    /// Of the view: panels and bars show colours, too.
    template <class Is>
    Spot spot(Is&& is) const
    {
        Spot spot;
        for (int y = height / 10; y < height * 8 / 10; ++y)
            for (int x = kTools; x < width * 7 / 10; ++x)
            {
                const std::size_t at = 3 * idx(y * width + x);
                const auto channel = [&](std::size_t c)
                { return static_cast<int>(static_cast<unsigned char>(rgb[at + c])); };
                if (!is(channel(0), channel(1), channel(2)))
                    continue;
                ++spot.pixels;
                spot.x += x;
                spot.y += y;
            }
        spot.x /= std::max(spot.pixels, 1);
        spot.y /= std::max(spot.pixels, 1);
        return spot;
    }
};

bool is_yellow(int r, int g, int b)
{
    return r > g && g > b + 50 && 10 * g > 7 * r;
}
bool is_blue(int r, int g, int b)
{
    return b > r + 40 && g > r;
}
bool is_grey(int r, int g, int b)
{
    return r > 80 && r < 200 && std::abs(r - g) < 14 && std::abs(b - g) < 18;
}

/// Both ends of the bar become regions, and the right one is dragged up.
std::string bending(const std::string& folder)
{
    return "size 1200 800\n"
           "key 1 alt\nkey home\nwait\n"
           "shot " +
           folder +
           "/rest.ppm\n"
           "tool box\n"
           "drag 0.01vw 0.2vh 0.2vw 0.8vh 5\nkey j\n"
           "tool box\n"
           "drag 0.99vw 0.2vh 0.8vw 0.8vh 5\nkey h\nkey a alt\ntool move\nwait\n"
           "shot " +
           folder +
           "/regions.ppm\n"
           "drag 0.905vw 0.58vh 0.8vw 0.28vh 12\nwait\n"
           "shot " +
           folder + "/bent.ppm\n";
}

} // namespace

TEST(EditorProgram, without_a_display_says_so_and_exits_with_2)
{
    const Result result = support::run_program(CELLWARP_EDITOR_BINARY, {},
                                               []
                                               {
                                                   ::unsetenv("DISPLAY");
                                                   ::unsetenv("WAYLAND_DISPLAY");
                                               });
    EXPECT_EQ(result.code, 2);
    EXPECT_TRUE(contains(result.err, "error: the editor needs a display")) << result.err;
    EXPECT_EQ(result.out, "");
}

TEST(EditorProgram, tells_its_usage_and_version_without_a_display)
{
    const auto run = [](const std::string& flag)
    {
        return support::run_program(CELLWARP_EDITOR_BINARY, {flag},
                                    [] { ::unsetenv("DISPLAY"); });
    };
    const Result help = run("--help");
    EXPECT_EQ(help.code, 0);
    EXPECT_TRUE(contains(help.out, "cellwarp-editor samples/bar.json")) << help.out;
    EXPECT_TRUE(contains(help.out, "drag X0 Y0 X1 Y1 N"));
    EXPECT_EQ(run("--version").code, 0);
    EXPECT_EQ(run("--nonsense").code, 2);
}

TEST_F(EditorWindow, bends_a_bar_and_what_it_saves_replays_to_the_same_bytes)
{
    const std::string model = bar();
    const Result result =
        play(bending(folder_.path().string()) + "undo\nwait\nshot " + file("undone.ppm") +
                 "\nredo\nwait\nshot " + file("again.ppm") + "\nshot " +
                 file("twice.ppm") + "\nsave " + file("saved.json") + "\nexport " +
                 file("editor.obj") + "\nquit\n",
             {model, "--report", file("report.json")});
    ASSERT_EQ(result.code, 0) << result.err;

    const Picture rest(file("rest.ppm")), regions(file("regions.ppm")),
        bent(file("bent.ppm")), undone(file("undone.ppm"));
    EXPECT_GT(rest.spot(is_blue).pixels, 5000) << "the model is seen, all of it free";
    EXPECT_EQ(rest.spot(is_yellow).pixels, 0);
    EXPECT_GT(regions.spot(is_grey).pixels, 1000) << "what is fixed is grey";
    EXPECT_GT(regions.spot(is_yellow).pixels, 1000) << "handles are yellow";
    EXPECT_LT(bent.spot(is_yellow).y, regions.spot(is_yellow).y - 40) << "it went up";
    EXPECT_NEAR(bent.spot(is_grey).x, regions.spot(is_grey).x, 30) << "it stayed";
    EXPECT_NEAR(undone.spot(is_yellow).y, regions.spot(is_yellow).y, 1.0);
    EXPECT_EQ(Picture(file("again.ppm")).without_times(),
              Picture(file("twice.ppm")).without_times());

    const Result deform =
        support::run({"deform", file("saved.json"), "-o", file("replayed.obj")});
    ASSERT_EQ(deform.code, 0) << deform.err;
    EXPECT_EQ(bytes_of(file("editor.obj")), bytes_of(file("replayed.obj")));
    EXPECT_NE(bytes_of(file("editor.obj")), bytes_of(model));

    const auto report = nlohmann::json::parse(bytes_of(file("report.json")));
    ASSERT_EQ(report["drags"].size(), 3u);
    EXPECT_EQ(report["drags"][2]["events"], 12);
    EXPECT_GT(report["drags"][2]["frame_ms"]["median"].get<double>(), 0.0);
    ASSERT_GE(report["waits"].size(), 2u);
    for (const auto& wait : report["waits"])
    {
        EXPECT_GT(wait["shape_ms"].get<double>(), 0.0) << wait;
        EXPECT_GE(wait["ms"], wait["shape_ms"]) << wait;
    }
}

TEST_F(EditorWindow, plays_nothing_that_it_does_not_know)
{
    const Result unknown = play("size 600 400\n\nfly away  # to where?\n");
    EXPECT_EQ(unknown.code, 3);
    EXPECT_TRUE(contains(unknown.err, "script:3: no statement 'fly'")) << unknown.err;
    const Result short_one = play("drag 1 2 3\n");
    EXPECT_EQ(short_one.code, 3);
    EXPECT_TRUE(contains(short_one.err, "script:1:")) << short_one.err;
    const Result place = play("move 0.5q 3\n");
    EXPECT_EQ(place.code, 3);
    EXPECT_TRUE(contains(place.err, "script:1: move: ")) << place.err;
    const std::string model = bar();
    for (const auto& [script, what] :
         {std::pair<std::string, std::string>{"point rod -1 0 0 0\n",
                                              "points count from 0"},
          {"wait\npoint rod 0 0 0 0\n", "rod"},
          {"wait\nfilm 3\n", "there is nothing to play"},
          {"wait\nlive 1\n", "the scene has no flesh in time"}})
    {
        const Result refused = play(script, {model});
        EXPECT_EQ(refused.code, 3) << script << refused.err;
        EXPECT_TRUE(contains(refused.err, what)) << script << refused.err;
    }
    folder_.write("rope.json", R"({"cellwarp": 1, "model": "bar.obj", "rods": [{"through":
        [[0,0,0],[0,0,4]], "fixed": [{"at": 0}], "carries": true}],
        "simulate": {"dt": 0.01, "duration": 0.03, "every": 0.01}})");
    const Result beyond = play("wait\nfilm 99\n", {file("rope.json")});
    EXPECT_TRUE(contains(beyond.err, "the film has no frame 99")) << beyond.err;
    EXPECT_EQ(play("quit\n", {file("nothing.obj")}).code, 4);
    EXPECT_EQ(play("quit\n", {folder_.write("bad.obj", "v 1 2\n")}).code, 3);
    EXPECT_EQ(support::run_program(CELLWARP_EDITOR_BINARY, {"--play", file("no-script")},
                                   on_display())
                  .code,
              4);
}

TEST_F(EditorWindow, tells_what_a_statement_needs)
{
    for (const auto& [statements, words] :
         {std::pair<std::string, std::string>{"wheel up 1", "a number is needed"},
          {"frames 0", "a number from 1 to 1000000 is needed"},
          {"size 100000 100000", "the display does not make the window that large"},
          {"press top", "no button 'top'"},
          {"press left hyper", "no modifier 'hyper'"},
          {"key F77", "no key 'F77'"},
          {"text \xc3\xa4", "only signs of ASCII"},
          {"tool hammer", "no tool 'hammer'"},
          {"region head", "no region 'head'"},
          {"make loose", "no role 'loose'"},
          {"place head 1 2 3 4", "a region and 3, 7 or 10 numbers"},
          {"place head 0 0 0 0 0 0 5", "the axis has no length"},
          {"place head 0 0 1", "there is no region 'head'"},
          {"show faces maybe", "on or off is needed"},
          {"show moon on", "nothing is called 'moon'"},
          {"undo", "there is nothing to undo"},
          {"redo", "there is nothing to redo"},
          {"recover yes", "there is nothing to recover"},
          {"recover maybe", "yes or no is needed"},
          {bending(folder_.path().string()) + "place handle 1e160 0 0\nwait",
           "no solution"},
          {"export " + file("out.stl"), "script:1: export: "}})
    {
        SCOPED_TRACE(statements);
        const Result result = play(statements + "\n", {bar()});
        EXPECT_NE(result.code, 0);
        EXPECT_TRUE(contains(result.err, words)) << result.err;
    }
    const Result nothing = play("region head\n");
    EXPECT_TRUE(contains(nothing.err, "no file is open")) << nothing.err;
}

TEST_F(EditorWindow, a_saved_turn_about_a_pivot_opens_with_its_history_and_view)
{
    const std::string model = bar();
    const Result saved = play(bending(folder_.path().string()) +
                                  "place handle 0 0 0  0 0 1 30  0.5 0.25 0.125\nwait\n"
                                  "drag 0.5vw 0.1vh 0.6vw 0.2vh 4 middle\nframes 2\n"
                                  "save " +
                                  file("turned.json") + "\nshot " + file("closed.ppm"),
                              {model});
    ASSERT_EQ(saved.code, 0) << saved.err;
    EXPECT_TRUE(contains(bytes_of(file("turned.handles")),
                         "rotate 0 0 1 30 about 0.5 0.25 0.125"))
        << bytes_of(file("turned.handles"));
    // The same view, and all edits to undo: those of the regions too.
    const Result opened =
        play("size 1200 800\nwait\nframes 2\nshot " + file("opened.ppm") +
                 "\nundo\nundo\nwait\nframes 2\nshot " + file("before.ppm"),
             {file("turned.json")});
    ASSERT_EQ(opened.code, 0) << opened.err;
    const auto yellow = [&](const char* name)
    { return Picture(file(name)).spot(is_yellow); };
    EXPECT_NEAR(yellow("opened.ppm").x, yellow("closed.ppm").x, 2.0);
    EXPECT_NEAR(yellow("opened.ppm").y, yellow("closed.ppm").y, 2.0);
    EXPECT_GT(std::hypot(yellow("before.ppm").x - yellow("opened.ppm").x,
                         yellow("before.ppm").y - yellow("opened.ppm").y),
              10.0);
}

TEST_F(EditorWindow, draws_what_has_changed_and_shows_the_rest_again)
{
    struct Switch
    {
        std::string there, back;
    };
    const std::vector<Switch> changes = {
        {"show edges on", "show edges off"},
        {"show colours off", "show colours on"},
        {"show ghost on", "show ghost off"},
        {"show floor off", "show floor on"},
        {"show cells on", "show cells off"},
        {"show dark off", "show dark on"},
        {"key 3 alt", "key 1 alt\nkey home"},
        {"undo\nwait", "redo\nwait"},
        {"key a", "key a alt"}, // all selected, and nothing
        {"size 900 700", "size 1200 800"}};
    std::string script = bending(folder_.path().string()) + "key 1 alt\nkey home\nwait\n";
    const auto shoot = [&](const std::string& statements, std::size_t number)
    {
        script += statements + "\nwait\nshot " + file(std::to_string(number) + ".ppm") +
                  "\nframes 3\nshot " + file(std::to_string(number) + "later.ppm") + "\n";
    };
    shoot("", 0);
    for (std::size_t k = 0; k < changes.size(); ++k)
    {
        shoot(changes[k].there, 2 * k + 1);
        shoot(changes[k].back, 2 * k + 2);
    }
    const Result result = play(script + "quit\n", {bar()});
    ASSERT_EQ(result.code, 0) << result.err;
    const auto view = [&](std::size_t number, const std::string& when = "")
    { return Picture(file(std::to_string(number) + when + ".ppm")).view(); };
    const std::string first = view(0);
    for (std::size_t k = 0; k < changes.size(); ++k)
    {
        EXPECT_NE(view(2 * k + 1), first) << changes[k].there;
        EXPECT_EQ(view(2 * k + 1, "later"), view(2 * k + 1)) << changes[k].there;
        EXPECT_EQ(view(2 * k + 2), first) << changes[k].back;
        EXPECT_EQ(view(2 * k + 2, "later"), first) << changes[k].back;
    }
}

TEST_F(EditorWindow, is_drawn_at_any_size)
{
    const Result result = play("size 1200 800\nframes 2\nsize 60 40\nframes 2\n"
                               "size 300 900\nmove 0.5vw 0.5vh\nshot " +
                                   file("narrow.ppm") + "\nquit\n",
                               {bar()});
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(Picture(file("narrow.ppm")).height, 900);
}

TEST_F(EditorWindow, draws_another_selection_of_many_samples_coarse_first)
{
    const std::string model = folder_.write(
        "many.obj",
        support::obj_text(support::box_shape({-2, -0.4, -0.4}, {2, 0.4, 0.4}, 90)));
    const std::string report = file("report.json");
    const Result result = play("size 1200 800\nkey 1 alt\nwait\nframes 3\ntool box\n"
                               "drag 0.01vw 0.2vh 0.4vw 0.8vh 4\nframes 2\nshot " +
                                   file("whole.ppm") + "\nquit\n",
                               {"--report", report, model});
    ASSERT_EQ(result.code, 0) << result.err;
    const auto json = nlohmann::json::parse(bytes_of(report));
    EXPECT_TRUE(json["drags"][0]["release_ms"]["is_coarse"]);
    EXPECT_GT(Picture(file("whole.ppm"))
                  .spot([](int r, int g, int b) { return r > b + 60 && r > g + 40; })
                  .pixels,
              1000);
}

TEST_F(EditorWindow, keeps_what_is_edited_when_a_signal_ends_it)
{
    const std::string model = bar();
    const std::string scene =
        folder_.write("s.json", R"({"cellwarp": 1, "model": "bar.obj"})");
    for (const std::string& opened : {model, scene})
    {
        RunningEditor editor(*this, opened);
        if (!editor.is_there())
            GTEST_SKIP() << "xdotool is not installed";
        const std::string name = std::filesystem::path(opened).filename().string();
        editor.type({"a", "j"}); // all of it is fixed
        editor.wait_for_edits(2);
        editor.send(SIGTERM);
        EXPECT_EQ(editor.wait_for_end(), 143) << name;
        // The next one goes on with it.
        const Document next(opened, file("cellwarp/journals"));
        EXPECT_EQ(next.num_recoverable(), 0u) << name;
        ASSERT_EQ(next.regions().size(), 1u) << name;
        EXPECT_EQ(next.regions()[0].role, Role::Fixed);
        EXPECT_EQ(next.is_saved(), opened == scene);
        EXPECT_TRUE(next.can_undo());
    }
    EXPECT_TRUE(contains(bytes_of(file("s.handles")), "fixed "));
}

TEST_F(EditorWindow, serves_real_events_of_the_display)
{
    RunningEditor editor(*this, bar());
    if (!editor.is_there())
        GTEST_SKIP() << "xdotool is not installed";
    editor.type({"alt+1", "Home", "alt+z"});
    editor.key(support::kDigit + 2);
    editor.drag({70, 250}, {300, 700});
    editor.type({"j", "ctrl+s", "Return"});
    for (int k = 0; k < 100 && !std::filesystem::exists(file("bar-edit.handles")); ++k)
        support::pause(200);
    EXPECT_TRUE(contains(bytes_of(file("bar-edit.handles")), "fixed "));
    editor.type({"ctrl+q"});
    EXPECT_EQ(editor.wait_for_end(), 0);
}

TEST_F(EditorWindow, a_press_counts_where_it_was_made_even_if_the_window_stood_still_then)
{
    const auto edits = [&](bool stops)
    {
        RunningEditor editor(*this, bar());
        editor.type({"alt+1", "Home"});
        editor.key(support::kDigit + 2);
        if (stops)
            editor.send(SIGSTOP);
        editor.drag({70, 250}, {300, 700});
        // A click on a tool, and the way back to the view.
        editor.click(editor.tool(2));
        editor.drag({900, 250}, {1000, 700});
        editor.click(editor.tool(1));
        editor.drag({500, 250}, {700, 700});
        if (stops)
            editor.send(SIGCONT);
        return editor.edits(3);
    };
    if (!RunningEditor(*this, bar()).is_there())
        GTEST_SKIP() << "xdotool is not installed";
    const std::vector<std::string> running = edits(false);
    ASSERT_EQ(running.size(), 3u);
    EXPECT_TRUE(contains(running[0], "Select by box")) << running[0];
    EXPECT_TRUE(contains(running[1], "Select by lasso")) << running[1];
    EXPECT_TRUE(contains(running[2], "Select by box")) << running[2];
    EXPECT_EQ(edits(true), running);
}

namespace
{

/// Physical keys that have a letter on a layout, by its characters.
struct Keyboard
{
    const char* name;
    int a, j, h, k, i, z, o, s;
};

/// The gestures of a first session, on a keyboard with a layout; the edits that came out.
std::vector<std::string> session(const EditorWindow& window, const std::string& model,
                                 const Keyboard& on)
{
    RunningEditor editor(window, model, on.name);
    const auto digit = [](int number) { return support::kDigit + number; };
    editor.key(digit(1), {"Alt_L"}); // from the front
    editor.type({"Home"});
    editor.key(digit(2)); // box
    editor.drag({70, 250}, {300, 700});
    editor.key(on.j);
    editor.key(digit(3)); // lasso
    editor.drag({900, 250}, {1000, 700});
    editor.key(on.h);
    editor.key(on.a);
    editor.key(on.i, {"Control_L"}); // nothing
    editor.key(on.z, {"Control_L"});
    editor.key(on.z, {"Control_L", "Shift_L"});
    editor.key(on.o, {"Control_L"}); // a dialog, and no box behind it
    editor.drag({400, 250}, {500, 700});
    editor.type({"Escape"});
    editor.key(digit(4)); // brush
    editor.drag({500, 450}, {600, 450});
    editor.key(on.k);
    editor.key(on.s, {"Control_L"}); // the name is emptied, so nothing is saved
    editor.key(on.a, {"Control_L"});
    editor.type({"Delete", "Return", "Escape"});
    editor.key(on.a);
    return editor.edits(9);
}

} // namespace

TEST_F(EditorWindow, has_its_shortcuts_on_every_layout_of_the_keyboard)
{
    if (support::installed("setxkbmap").empty() ||
        !RunningEditor(*this, bar()).is_there())
        GTEST_SKIP() << "setxkbmap or xdotool is not installed";
    const std::vector<std::string> edits =
        session(*this, bar(), {"us", 38, 44, 43, 45, 31, 52, 32, 39});
    const std::vector<std::string> names = {
        "Select by box", "Make fixed", "Select by lasso",
        "Make handle",   "Select all", "Invert selection",
        "at 5",          "at 6",       "Select by brush",
        "Make stiff",    "Select all"};
    ASSERT_EQ(edits.size(), names.size());
    for (std::size_t k = 0; k < names.size(); ++k)
        EXPECT_TRUE(contains(edits[k], names[k])) << edits[k];
    EXPECT_FALSE(std::filesystem::exists(file("bar-edit.json")));
    for (const Keyboard& layout : {Keyboard{"fr", 24, 44, 43, 45, 31, 25, 32, 39},
                                   Keyboard{"ru", 38, 44, 43, 45, 31, 52, 32, 39},
                                   Keyboard{"de", 38, 44, 43, 45, 31, 29, 32, 39}})
    {
        EXPECT_EQ(session(*this, bar(), layout), edits) << layout.name;
        EXPECT_FALSE(std::filesystem::exists(file("bar-edit.json"))) << layout.name;
    }
}

} // namespace cellwarp::core
