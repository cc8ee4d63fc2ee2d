// SPDX-License-Identifier: GPL-3.0-or-later
// Parts of the window that need no display.
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>

#include "editor/window/colours.h"
#include "editor/window/editor_app.h"
#include "editor/window/frame_times.h"
#include "editor/window/places.h"
#include "editor/window/playback.h"
#include "editor/window/warning_words.h"
#include "editor/window/window.h"
#include "io/base/error.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::Folder;

TEST(Window, is_no_larger_than_a_screen_and_its_title_leave)
{
    using Size = Eigen::Vector2i;
    const Size wanted(1400, 900);
    EXPECT_EQ(size_within(wanted, 1.0, {1920, 1080}), wanted);
    EXPECT_EQ(size_within(wanted, 1.0, {1280, 720}), Size(1280, 688));
    EXPECT_EQ(size_within(wanted, 2.0, {3840, 2160}), Size(2800, 1800));
    EXPECT_EQ(size_within(wanted, 2.0, {2560, 1440}), Size(2560, 1376));
    // Where nobody knows.
    EXPECT_EQ(size_within(wanted, 1.0, {0, 0}), wanted);
}

TEST(Window, knows_a_key_by_its_letter_or_else_by_its_place)
{
    struct OnLayout
    {
        char place; ///< its character on the US layout
        const char* on_layout;
        char character;
    };
    for (const auto& [place, on_layout, character] : {OnLayout{'Q', "q", 'q'},
                                                      {'Q', "a", 'a'},
                                                      {'W', "z", 'z'},
                                                      {'Y', "z", 'z'}, // fr, de
                                                      {'A', "ф", 'a'},
                                                      {'[', "х", '['},
                                                      {';', "m", 'm'}, // ru, fr
                                                      {'M', ",", ','},
                                                      {'[', "ü", '['},
                                                      {']', "+", '+'},
                                                      {'/', "-", '-'},
                                                      {'1', "&", '1'},
                                                      {'7', "è", '7'},
                                                      {'2', "ě", '2'},
                                                      {'0', "à", '0'},
                                                      {'[', "", '['},
                                                      {'G', "γ", 'g'},
                                                      {'G', "G", 'g'}})
        EXPECT_EQ(key_character(place, on_layout), character) << place << on_layout;
    EXPECT_EQ(key_character(340, ""), 0);    // Shift
    EXPECT_EQ(key_character(161, "<"), '<'); // beside it, where there is one more key
    EXPECT_EQ(key_character(-1, ""), 0);
}

TEST(FrameTimes, of_the_last_whole_frames_last_until_there_are_others)
{
    LastFrames frames;
    EXPECT_EQ(frames.median(), 0.0);
    for (const double ms : {400.0, 20.0, 500.0})
        frames.add(ms);
    EXPECT_EQ(frames.median(), 400.0);
    for (int k = 0; k < 3; ++k)
        frames.add(10.0); // zoomed away, it is fast again
    EXPECT_EQ(frames.median(), 10.0);
    frames.clear();
    EXPECT_EQ(frames.median(), 0.0);
}

TEST(FrameTimes, are_those_of_the_last_two_seconds)
{
    FrameTimes times;
    EXPECT_EQ(times.median(), 0.0);
    times.add(10.0, 500.0);
    for (int k = 0; k < 5; ++k)
        times.add(11.0 + 0.1 * k, 10.0 + k);
    EXPECT_EQ(times.worst(), 500.0);
    EXPECT_EQ(times.median(), 13.0);
    times.add(12.5, 12.0);
    EXPECT_EQ(times.worst(), 14.0);
}

TEST(RecentFiles, come_back_the_newest_first_and_once)
{
    const Folder folder;
    RecentFiles first(folder.path().string());
    EXPECT_TRUE(first.paths().empty());
    first.add("/models/a.obj");
    first.add("/models/b.obj");
    first.add("/models/../models/a.obj");
    const RecentFiles again(folder.path().string());
    EXPECT_EQ(again.paths(),
              (std::vector<std::string>{"/models/a.obj", "/models/b.obj"}));
    first.forget("/models/a.obj");
    EXPECT_EQ(RecentFiles(folder.path().string()).paths(),
              std::vector<std::string>{"/models/b.obj"});
    RecentFiles nowhere("");
    nowhere.add("/models/a.obj");
    EXPECT_EQ(nowhere.paths().size(), 1u);
}

TEST(RecentFiles, are_the_same_by_any_spelling)
{
    const Folder folder;
    const std::string model = folder.write("bar.obj", "v 0 0 0\n");
    std::filesystem::create_directory(folder.path() / "sub");
    std::filesystem::create_symlink(model, folder.path() / "link.obj");
    const std::string dotted = (folder.path() / "sub" / ".." / "bar.obj").string();
    const std::string link = (folder.path() / "link.obj").string();
    EXPECT_TRUE(is_same_path(model, dotted));
    EXPECT_TRUE(is_same_path(model, link));
    EXPECT_FALSE(is_same_path(model, model + "x"));
    RecentFiles recent("");
    recent.add(model);
    recent.add(link);
    EXPECT_EQ(recent.paths(), std::vector<std::string>{link});
    recent.forget(dotted);
    EXPECT_TRUE(recent.paths().empty());
}

TEST(RecentFiles, do_not_grow_without_end)
{
    const Folder folder;
    RecentFiles recent(folder.path().string());
    for (int k = 0; k < 100; ++k)
        recent.add("/models/" + std::to_string(k));
    EXPECT_LE(recent.paths().size(), 20u);
    EXPECT_EQ(recent.paths().front(), "/models/99");
}

TEST(CellColours, rise_with_the_gap_over_at_most_three_powers_of_ten)
{
    ShownCells cells;
    for (const float gap : {0.0f, 1e-5f, 1e-4f, 1e-2f})
        cells.cells.emplace_back().gap = gap;
    const CellScale scale = cell_scale(cells, CellColours::Gap);
    EXPECT_FLOAT_EQ(scale.low, 1e-5f);
    EXPECT_FLOAT_EQ(scale.high, 1e-2f);
    const auto colour = [&](std::size_t c)
    { return cell_colour(cells.cells[c], CellColours::Gap, scale, {}); };
    EXPECT_EQ(colour(0), scale_colour(0.0)) << "no gap at all";
    EXPECT_EQ(colour(1), scale_colour(0.0));
    EXPECT_EQ(colour(3), scale_colour(1.0));
    EXPECT_NE(colour(2), colour(1));
}

TEST(CellColours, are_calm_where_all_cells_are_alike)
{
    ShownCells cells;
    EXPECT_EQ(cell_scale(cells, CellColours::Depth).high, 1.0f) << "no cell";
    cells.cells.resize(3);
    for (const CellColours by : {CellColours::Gap, CellColours::Depth})
        EXPECT_EQ(cell_colour(cells.cells[0], by, cell_scale(cells, by), {}),
                  scale_colour(0.0));
}

TEST(CellColours, of_regions_are_those_of_their_roles)
{
    const std::vector<EditedRegion> regions(1); // fixed
    ShownCell cell;
    EXPECT_EQ(cell_colour(cell, CellColours::Region, {}, regions), free_colour());
    cell.region = 0;
    EXPECT_EQ(cell_colour(cell, CellColours::Region, {}, regions),
              colour_of(Role::Fixed));
    cell.region = 7; // of a document that has changed meanwhile
    EXPECT_EQ(cell_colour(cell, CellColours::Region, {}, regions), free_colour());
}

TEST(EditorApp, goes_on_whatever_is_thrown_while_it_updates)
{
    EditorApp app(false);
    EXPECT_TRUE(app.guard([] {}));
    for (int k = 0; k < 2; ++k)
    {
        EXPECT_FALSE(app.guard([] { throw Error(Fault::File, "the disk is gone"); }));
        ASSERT_NE(app.notice(Place::Window), nullptr);
        EXPECT_EQ(app.notice(Place::Window)->text, "the disk is gone");
        EXPECT_TRUE(app.notice(Place::Window)->is_error);
    }
    app.guard([] {}); // goes well, and takes nothing away that was not read yet
    EXPECT_NE(app.notice(Place::Window), nullptr);
    EXPECT_FALSE(app.guard([] { throw std::bad_alloc(); }));
    EXPECT_EQ(app.notice(Place::Window)->text, "out of memory");
    EXPECT_FALSE(app.guard([] { throw std::runtime_error("no thread"); }));
    EXPECT_EQ(app.notice(Place::Window)->text, "internal error: no thread");
    app.attempt(Place::Window, [] {});
    EXPECT_EQ(app.notice(Place::Window), nullptr);
}

TEST(EditorApp, keeps_a_file_that_another_window_has_open_among_the_recent_ones)
{
    const support::Folder folder;
    const std::string state = folder / "state";
    const char* const before = std::getenv("XDG_STATE_HOME");
    const std::string old = before == nullptr ? "" : before;
    ::setenv("XDG_STATE_HOME", state.c_str(), 1);
    {
        const std::string model = folder.write(
            "bar.obj", support::obj_text(support::box_shape({0, 0, 0}, {3, 1, 1}, 4)));
        EditorApp first(true);
        first.open(model);
        first.finish_opening();
        EditorApp second(true);
        ASSERT_EQ(second.recent.paths().size(), 1u);
        const auto try_to_open = [&](const std::string& path)
        {
            second.open(path);
            while (second.is_opening())
                second.update();
        };
        try_to_open(model);
        ASSERT_NE(second.notice(Place::Window), nullptr);
        EXPECT_TRUE(support::contains(second.notice(Place::Window)->text,
                                      "bar.obj: is open in another window (in use by"));
        EXPECT_EQ(second.recent.paths().size(), 1u);
        first.close();
        std::filesystem::remove(model); // but one that is gone is struck off
        try_to_open(model);
        EXPECT_TRUE(second.recent.paths().empty());
    }
    before == nullptr ? ::unsetenv("XDG_STATE_HOME")
                      : ::setenv("XDG_STATE_HOME", old.c_str(), 1);
}

TEST(WarningWords, are_those_of_the_window)
{
    const support::Folder folder;
    const Document document(folder.write("bar.obj", support::obj_text(support::box_shape(
                                                        {0, 0, 0}, {3, 1, 1}, 4))),
                            "");
    EXPECT_EQ(in_window_words(document.path() + ":12: head: frame 1: turns about the "
                                                "middle of its box, 0.1 of the diagonal "
                                                "off where it is attached ('about "
                                                "border' turns it there)",
                              document),
              "head: frame 1: turns about the middle of its box, 0.1 of the diagonal off "
              "where it is attached (Shift+V turns it there)");
    EXPECT_TRUE(support::contains(
        in_window_words(
            "2 pairs of triangles intersect that do not at rest, the first at "
            "1 2 3: parts pass through each other",
            document),
        "(Contact, under Cells, keeps them apart)"));
    EXPECT_EQ(in_window_words("raise --across or --max-depth", document),
              "raise Across (under Cells) or Depth (under Cells)");
}

TEST(EditorApp, solves_on_when_a_label_file_has_gone)
{
    const Folder folder;
    const Shape bar = support::box_shape({0, 0, 0}, {1, 1, 4}, 6);
    folder.write("bar.obj", support::obj_text(bar));
    std::string labels;
    for (const Eigen::Vector3d& x : bar.samples)
        labels += x.z() > 3.4 ? "1\n" : "0\n";
    const std::string file = folder.write("top.sel", labels);
    folder.write("s.handles", "cellwarp-handles 1\nfixed foot box -1 -1 -1 2 2 0.6\n"
                              "handle head labels top.sel 1\nframe 1\n"
                              "move head translate 0.3 0 0\ncommit\n"
                              "fixed foot box -1 -1 -1 2 2 0.6\n"
                              "handle head labels top.sel 1\n");
    EditorApp app(false);
    app.open(folder.write("s.json", R"({"cellwarp": 1, "model": "bar.obj",
        "handles": "s.handles", "cells": {"across": 8}})"));
    app.finish_opening();
    std::filesystem::remove(file);
    const Editing& editing = app.opened()->editing;
    for (int k = 0; k < 60'000 && !editing.result() && !app.notice(Place::Window); ++k)
    {
        app.update();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_EQ(app.notice(Place::Window), nullptr);
}

TEST(EditorApp, asks_before_it_overwrites_what_another_program_has_written)
{
    const Folder folder;
    folder.write("bar.obj",
                 support::obj_text(support::box_shape({0, 0, 0}, {1, 1, 4}, 4)));
    const std::string scene =
        folder.write("s.json", R"({"cellwarp": 1, "model": "bar.obj"})");
    EditorApp app(false);
    app.open(scene);
    app.finish_opening();
    const auto edit = [&](double z)
    {
        Selection selection(app.document().selection().num_samples());
        selection.add(static_cast<std::size_t>(z));
        app.document().select(selection, "Select");
        app.document().add_region(Role::Handle);
    };
    const auto theirs = [&](const std::string& note)
    {
        return folder.write("s.json", R"({"cellwarp": 1, "model": "bar.obj", "note": ")" +
                                          note + "\"}");
    };
    edit(1);
    theirs("one");
    app.save();
    EXPECT_TRUE(
        support::contains(app.asks_to_overwrite, "another program has changed it"));
    EXPECT_FALSE(app.document().is_saved());
    app.cancel_save();
    EXPECT_TRUE(app.asks_to_overwrite.empty());
    EXPECT_TRUE(support::contains(support::bytes_of(scene), "one"));
    // Under another name.
    app.save();
    app.save_elsewhere();
    EXPECT_TRUE(app.asks_to_overwrite.empty());
    EXPECT_EQ(app.choosing, Choosing::SaveAs);
    app.choosing.reset();
    // Over it, when the program is about to end: first the question, then the end.
    app.ask_to_quit();
    EXPECT_EQ(app.leaving, Leaving::ToQuit);
    app.leave(true);
    EXPECT_FALSE(app.asks_to_overwrite.empty());
    EXPECT_FALSE(app.wants_to_quit);
    app.overwrite();
    EXPECT_FALSE(support::contains(support::bytes_of(scene), "one"));
    EXPECT_TRUE(app.wants_to_quit);
}

TEST(EditorApp, tells_when_a_field_is_written)
{
    const Folder folder;
    EditorApp app(false);
    app.open(folder.write(
        "bar.obj", support::obj_text(support::box_shape({0, 0, 0}, {1, 1, 4}, 4))));
    app.finish_opening();
    Document& document = app.document();
    Selection selection(document.selection().num_samples());
    for (std::size_t i = 0; i < 10; ++i)
        selection.add(i);
    document.select(selection, "Select by box");
    document.add_region(Role::Handle, "all");
    RigidMove up;
    up.translation.z() = 1;
    document.move_region("all", up);
    app.export_field(folder / "up.cwf", Overwrite::No);
    EXPECT_FALSE(app.is_idle());
    for (int k = 0; k < 60'000 && !app.notice(Place::Window); ++k)
    {
        app.update();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ASSERT_NE(app.notice(Place::Window), nullptr);
    EXPECT_EQ(app.notice(Place::Window)->text, "Written: " + (folder / "up.cwf"));
    EXPECT_TRUE(std::filesystem::exists(folder / "up.cwf"));
}

TEST(Playback, reads_statements_with_their_lines)
{
    const Folder folder;
    const std::string path =
        folder.write("script", "# a comment\n\nsize 800 600 # of the window\r\nquit");
    const std::vector<Statement> statements = read_statements(path);
    ASSERT_EQ(statements.size(), 2u);
    EXPECT_EQ(statements[0].line, 3);
    EXPECT_EQ(statements[0].words, (std::vector<std::string>{"size", "800", "600"}));
    EXPECT_EQ(statements[1].line, 4);
}

TEST(Playback, refuses_statements_with_too_many_words_or_too_few)
{
    const Folder folder;
    for (const char* text : {"size 800", "wait long", "press", "undo 2", "key"})
    {
        SCOPED_TRACE(text);
        const std::string path = folder.write("script", text);
        EXPECT_THROW(read_statements(path), Error);
    }
}

TEST(PlaybackReport, tells_medians_and_worst_and_null_of_what_was_not_measured)
{
    PlaybackReport report;
    DragTimes& drag = report.drags.emplace_back();
    for (const double ms : {3.0, 1.0, 2.0, 50.0, 2.5})
        drag.frames.push_back({.total = ms, .is_drawn = true});
    drag.frames.push_back({.total = 0.125}); // the last picture was shown again
    const std::string text = report_text(report);
    EXPECT_TRUE(support::contains(text, "\"events\": 6")) << text;
    EXPECT_TRUE(support::contains(text, "\"drawn_frames\": 5")) << text;
    EXPECT_FALSE(support::contains(text, "0.125")) << text;
    EXPECT_TRUE(support::contains(text, "\"median\": 2.5")) << text;
    EXPECT_TRUE(support::contains(text, "\"worst\": 50.0")) << text;
    EXPECT_TRUE(support::contains(text, "\"solve_ms\": null")) << text;
}

} // namespace cellwarp::core
