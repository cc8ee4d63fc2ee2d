// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/film.h"

#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/scripts.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;

namespace
{

/// A bar that a rod swings, and its foot held by a handle file.
struct Scene
{
    support::Folder folder;
    std::string path;

    explicit Scene(const std::string& radius = "0.1")
    {
        folder.write("bar.obj", support::obj_text(support::long_bar()));
        folder.write("h.handles",
                     "cellwarp-handles 1\nfixed foot box -1 -1 -1 1 1 0.3\n");
        path = folder.write("s.json", R"({"cellwarp": 1, "model": "bar.obj",
            "handles": "h.handles", "cells": {"across": 12}, "rods": [{"name": "spine",
            "through": [[0,0,0.6],[0,0,4]], "carries": true, "radius": )" +
                                          radius +
                                          R"(,
            "fixed": [{"at": 0, "what": ["point", "tangent", "twist"]}]}],
            "simulate": {"dt": 0.01, "duration": 0.2, "every": 0.05}})");
    }
};

void wait(const Film& film)
{
    while (film.is_working())
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

} // namespace

TEST(Film, has_the_frames_of_simulate_to_the_bit)
{
    const Scene scene;
    Editing editing(Document(scene.path, ""));
    EXPECT_TRUE(editing.document().warnings().empty());
    ASSERT_TRUE(Film::is_in(editing.document()));
    const Film film(editing);
    wait(film);
    EXPECT_EQ(film.error(), "");
    ASSERT_EQ(film.num_made(), 5);
    EXPECT_EQ(film.last(), 4);
    EXPECT_DOUBLE_EQ(film.seconds_a_frame(), 0.05);
    ASSERT_EQ(
        support::run({"simulate", scene.path, "-o", scene.folder / "f{frame}.obj"}).code,
        0);
    for (int frame = 0; frame <= 4; ++frame)
    {
        const Geometry baked =
            read_geometry(scene.folder / "f" + std::to_string(frame) + ".obj").geometry;
        EXPECT_EQ(film.shape(frame)->positions,
                  shown_at(baked, baked.samples, layout_of(baked), editing.view_frame())
                      .positions);
    }
    EXPECT_NE(film.shape(4)->positions, film.shape(0)->positions);
    EXPECT_EQ(film.shape(4)->lines[0].name, "spine");
}

TEST(Film, is_seen_instead_of_the_shape_and_nothing_is_in_the_hand_meanwhile)
{
    const Scene scene;
    Editing editing(Document(scene.path, ""));
    editing.document().add_line(Role::Rod, {{{0, 0, 1}, {0, 0, 3}}, false, std::nullopt},
                                "handle");
    editing.wait();
    const std::vector<float> rest = editing.shape().positions;
    const std::uint64_t version = editing.shape().version;
    {
        const Film film(editing);
        wait(film);
        editing.show_instead(film.shape(3));
        EXPECT_TRUE(editing.shows_film());
        EXPECT_EQ(editing.shape().positions, film.shape(3)->positions);
        EXPECT_GT(editing.shape().version, version);
    }
    std::string why;
    EXPECT_FALSE(editing.begin_point_drag("handle", 1, &why));
    EXPECT_TRUE(contains(why, "a film is shown"));
    editing.show_instead(nullptr);
    EXPECT_EQ(editing.shape().positions, rest);
    EXPECT_TRUE(editing.begin_point_drag("handle", 1, &why)) << why;
}

TEST(Film, frame_that_is_seen_is_the_one_that_is_exported)
{
    const Scene scene;
    Editing editing(Document(scene.path, ""));
    const Film film(editing);
    wait(film);
    ASSERT_EQ(
        support::run({"simulate", scene.path, "-o", scene.folder / "f{frame}.obj"}).code,
        0);
    const std::string out = scene.folder / "out.obj";
    for (const int frame : {0, 3})
    {
        editing.show_instead(film.shape(frame), film.deformed(frame));
        EXPECT_EQ(editing.why_no_export(), "");
        editing.export_model(out, Overwrite::Yes);
        EXPECT_EQ(support::bytes_of(out),
                  support::bytes_of(scene.folder / "f" + std::to_string(frame) + ".obj"));
    }
    // The field is of what is edited.
    EXPECT_TRUE(contains(editing.why_no_field_export(), "a film is seen"));
    EXPECT_THROW(editing.export_field(scene.folder / "f.cwf", Overwrite::Yes), Error);
    // A film that moves on by itself is not written.
    editing.show_instead(film.shape(4));
    EXPECT_TRUE(contains(editing.why_no_export(), "moves on"));
    EXPECT_TRUE(
        contains(support::error_of(Fault::Usage,
                                   [&] { editing.export_model(out, Overwrite::Yes); }),
                 "moves on"));
    // Without the film it is what is edited again, which nobody has asked for yet.
    editing.show_instead(nullptr);
    EXPECT_TRUE(contains(editing.why_no_export(), "at rest"));
    editing.solve();
    editing.wait();
    editing.export_model(out, Overwrite::Yes);
    EXPECT_EQ(support::bytes_of(out), support::bytes_of(scene.folder / "f0.obj"));
}

TEST(Film, that_cannot_be_says_why_and_one_that_is_dropped_ends)
{
    const Scene none(R"(0.1, "elasticity": "discrete", "degree": 2)");
    Editing editing(Document(none.path, ""));
    const Film film(editing);
    wait(film);
    EXPECT_EQ(film.num_made(), 0);
    EXPECT_TRUE(contains(film.error(), "rods[0].elasticity")) << film.error();
    const Scene scene;
    Editing other(Document(scene.path, ""));
    const auto start = std::chrono::steady_clock::now();
    for (int k = 0; k < 5; ++k)
        const Film dropped(other);
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60));
}

} // namespace cellwarp::core
