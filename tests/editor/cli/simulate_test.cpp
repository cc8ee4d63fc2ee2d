// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp simulate, from the outside.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/inotify.h>
#include <unistd.h>

#include "io/formats/geometry_file.h"
#include "tests/support/extremes.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/sanitized.h"
#include "tests/support/scripts.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::Folder;
using support::Result;
using support::run;

namespace
{

constexpr char kRope[] = R"({"cellwarp": 1, "rods": [{"name": "rope",
    "through": [[0,0,0],[1,0,0]], "fixed": [{"at": 0}]}],
    "simulate": {"dt": 0.01, "duration": 0.1, "every": 0.05}})";

/// How often a file is opened while \p call runs.
template <class Call>
int times_opened(const std::string& file, const Call& call)
{
    const int queue = inotify_init1(IN_NONBLOCK);
    EXPECT_GE(inotify_add_watch(queue, file.c_str(), IN_OPEN | IN_CLOSE), 0);
    call();
    // Equal events in a row become one: that of closing the file comes in between.
    int count = 0;
    alignas(inotify_event) char events[4096];
    for (ssize_t size; (size = read(queue, events, sizeof events)) > 0;)
        for (ssize_t at = 0; at < size;
             at += static_cast<ssize_t>(sizeof(inotify_event)) +
                   reinterpret_cast<const inotify_event*>(events + at)->len)
            count += (reinterpret_cast<const inotify_event*>(events + at)->mask &
                      IN_OPEN) != 0;
    close(queue);
    return count;
}

} // namespace

TEST(SimulateCommand, a_scene_is_opened_once_a_run)
{
    const Folder folder;
    const std::string rope = folder.write("rope.json", kRope);
    folder.write("cube.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\n"
                             "v 1 1 1\nv 0 1 1\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\n"
                             "f 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    folder.write("cube.handles", "cellwarp-handles 1\nfixed low box 0 0 0 1 1 0.1\n"
                                 "handle high box 0 0 0.9 1 1 1\nframe 1\n"
                                 "move high translate 0 0 0.1\n");
    const std::string edit = folder.write("cube.json", R"({"cellwarp": 1,
        "model": "cube.obj", "handles": "cube.handles", "cells": {"across": 4}})");
    const std::string out = folder / "out.obj";
    for (const std::vector<std::string>& command :
         {std::vector<std::string>{"simulate", rope, "--json"},
          {"check", rope, "--json"},
          {"info", rope},
          {"deform", edit, "-o", out},
          {"check", edit},
          {"info", edit}})
        EXPECT_EQ(times_opened(command[1],
                               [&] { EXPECT_EQ(run(command).code, 0) << command[0]; }),
                  1)
            << command[0] << " " << command[1];
}

TEST(SimulateCommand, writes_frames_and_tells_of_them)
{
    const Folder folder;
    const std::string scene = folder.write("rope.json", kRope);
    const Result result =
        run({"simulate", scene, "-o", folder / "rope-{frame:02}.obj", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const nlohmann::json json = nlohmann::json::parse(result.out);
    ASSERT_EQ(json["frames"].size(), 3u);
    EXPECT_EQ(json["steps"], 10);
    EXPECT_EQ(json["frames"][1]["time"], 0.05);
    EXPECT_EQ(json["frames"][2]["stop"], "converged");
    EXPECT_EQ(json["frames"][2]["rods"][0]["name"], "rope");
    EXPECT_EQ(json["frames"][2]["rods"][0]["curve"].size(), 33u);
    EXPECT_LT(json["frames"][2]["rods"][0]["curve"][32][1].get<double>(), -0.01);
    EXPECT_LT(json["frames"][2]["constraint"].get<double>(), 1e-12);
    const Geometry tube = read_geometry(folder / "rope-02.obj").geometry;
    EXPECT_EQ(tube.samples.size() % 12, 0u);
    ASSERT_EQ(tube.groups.size(), 1u);
    EXPECT_EQ(tube.groups[0].name, "rope");
    EXPECT_EQ(tube.groups[0].end_face, tube.num_faces());
    EXPECT_EQ(run({"simulate", scene, "-o", folder / "rope.ply"}).code, 0);
    EXPECT_EQ(read_geometry(folder / "rope.ply").geometry.samples, tube.samples);
    // Any spacing of frames sees the same steps, with any number of threads.
    const std::string lines = folder / "lines.obj", again = folder / "again.obj";
    EXPECT_EQ(run({"simulate", scene, "-o", lines, "--lines"}).code, 0);
    EXPECT_EQ(run({"simulate", scene, "-o", again, "--threads", "1"}).code, 0);
    EXPECT_EQ(support::bytes_of(again), support::bytes_of(folder / "rope-02.obj"));
    EXPECT_TRUE(contains(support::bytes_of(lines), "l 1 2 3"));
}

TEST(SimulateCommand, scenes_of_rods_are_checked_without_it)
{
    const Folder folder;
    const std::string scene = folder.write("rope.json", kRope);
    const Result told = run({"check", scene});
    EXPECT_EQ(told.code, 0) << told.err;
    EXPECT_EQ(told.out, scene + ": 1 rod, 3 frames, 10 steps: in order\n");
    const Result as_json = run({"check", scene, "--json"});
    const nlohmann::json json = nlohmann::json::parse(as_json.out);
    EXPECT_TRUE(json["model"].is_null());
    EXPECT_EQ(json["frames"], 3);
    EXPECT_EQ(json["rods_in_time"][0]["name"], "rope");
    const Result wrong = run({"check", folder.write("wrong.json", R"({"cellwarp": 1,
        "rods": [{"through": [[0,0,0],[1,0,0]], "radius": -1}], "simulate": {}})")});
    EXPECT_EQ(wrong.code, 3);
    EXPECT_TRUE(contains(wrong.err, "rods[0].radius")) << wrong.err;
    const Result by_handles = run({"check", scene, "--handles", folder / "none.handles"});
    EXPECT_EQ(by_handles.code, 2);
    EXPECT_TRUE(contains(by_handles.err, "handles and moves are for edits"))
        << by_handles.err;
    // An edit beside rods in time: both are checked.
    const auto beside = [&](const std::string& radius)
    {
        return run({"check",
                    folder.write("beside.json",
                                 R"({"cellwarp": 1, "model": ")" +
                                     support::samples_folder() +
                                     R"(/bar.obj", "rods": [{"through": [[0,0,0],[1,0,0]],
            "radius": )" + radius + R"(}], "simulate": {"duration": 0.1}})")});
    };
    EXPECT_EQ(beside("0.1").code, 0) << beside("0.1").err;
    EXPECT_TRUE(contains(beside("0.1").out, "cells, ")) << beside("0.1").out;
    EXPECT_TRUE(contains(beside("0.1").out, "in time: 1 rod, ")) << beside("0.1").out;
    EXPECT_EQ(beside("-1").code, 3);
    EXPECT_TRUE(contains(beside("-1").err, "rods[0].radius")) << beside("-1").err;
    // Rods that carry a model: the scene is theirs.
    for (const char* name : {"hung", "stitch", "tentacle"})
        EXPECT_EQ(
            run({"check", support::samples_folder() + "/rods/" + name + ".json"}).code, 0)
            << name;
}

TEST(SimulateCommand, says_what_it_cannot_do)
{
    const Folder folder;
    const std::string scene = folder.write("rope.json", kRope);
    EXPECT_EQ(run({"simulate", scene}).code, 2);
    EXPECT_EQ(run({"simulate", scene, "-o", folder / "x.stl"}).code, 2);
    EXPECT_EQ(run({"simulate", scene, "-o", folder / "x.ply", "--lines"}).code, 2);
    EXPECT_EQ(run({"simulate", scene, "-o", "-", "--json"}).code, 2);
    const Result to_stdout = run({"simulate", scene, "--rods", "-", "--json"});
    EXPECT_EQ(to_stdout.code, 2);
    EXPECT_TRUE(contains(to_stdout.err, "--rods: need the name of a file"));
    EXPECT_EQ(run({"simulate", folder / "none.json", "--json"}).code, 4);
    const std::string long_one = folder.write(
        "long.json", R"({"cellwarp": 1, "rods": [{"through": [[0,0,0],[1,0,0]],
        "fixed": [{"at": 0}]}], "simulate": {"dt": 0.001, "duration": 2000, "every": 0.001}})");
    const Result many =
        run({"simulate", long_one, "-o", folder / "many-{frame}.obj", "--quiet"});
    EXPECT_EQ(many.code, 2) << many.err;
    EXPECT_TRUE(contains(many.err, "raise simulate.every")) << many.err;
    const std::string still =
        folder.write("still.json", R"({"cellwarp": 1, "model": "m.obj"})");
    const Result nothing = run({"simulate", still, "--json"});
    EXPECT_EQ(nothing.code, 3);
    EXPECT_TRUE(contains(nothing.err, "simulate: is missing: there is nothing to"))
        << nothing.err;
    // Its mesh has shapes: it can be read, and not be written.
    folder.write("shapes.gltf",
                 R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0},{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},
        "targets":[{"POSITION":0}]}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
        "bufferViews":[{"buffer":0,"byteLength":36}],
        "buffers":[{"byteLength":36,"uri":"data:;base64,)" +
                     std::string(48, 'A') + R"("}]})");
    const std::string shapes =
        folder.write("shapes.json", R"({"cellwarp": 1, "model": "shapes.gltf",
        "rods": [{"through": [[0,0,0],[1,0,0]], "fixed": [{"at": 0}], "carries": true}],
        "simulate": {"dt": 0.01, "duration": 0.03, "every": 0.01}})");
    const Result unwritable =
        run({"simulate", shapes, "-o", folder / "shapes-{frame}.gltf"});
    EXPECT_EQ(unwritable.code, 3);
    EXPECT_TRUE(contains(unwritable.err, "cannot be written: nodes[0]"))
        << unwritable.err;
    const std::string bad = folder.write("bad.json", R"({"cellwarp": 1, "rods": 7})");
    EXPECT_EQ(run({"simulate", bad, "--json"}).code, 3);
    folder.write("out.obj", "old");
    EXPECT_EQ(run({"simulate", scene, "-o", folder / "out.obj"}).code, 4);
    // Two places at once: the least that can be, and exit 7.
    const std::string torn = folder.write(
        "torn.json", R"({"cellwarp": 1, "rods": [{"through": [[0,0,0],[1,0,0]],
        "on": [{"at": 0, "point": [0,0,0]}, {"at": 0, "point": [0,0.1,0]}]}],
        "simulate": {"integrator": "static"}})");
    const Result result = run({"simulate", torn, "-o", folder / "torn.obj"});
    EXPECT_EQ(result.code, 7);
    EXPECT_TRUE(contains(result.err, "constraints are violated by up to")) << result.err;
    EXPECT_TRUE(std::filesystem::exists(folder / "torn.obj"));
    // What interface defaults say aloud is no demand.
    const std::string plain = folder.write(
        "plain.json", R"({"cellwarp": 1, "rods": [{"through": [[0,0,0],[1,0,0]],
        "fixed": [{"at": 0}], "carries": false, "refine": false}],
        "simulate": {"dt": 0.03, "duration": 0.1, "every": 0.06}})");
    EXPECT_EQ(run({"simulate", plain, "-o", folder / "p-{frame}.obj"}).code, 0);
    EXPECT_TRUE(std::filesystem::exists(folder / "p-2.obj"));
    // The last frame is looked for before any work, too.
    std::filesystem::remove(folder / "p-0.obj");
    std::filesystem::remove(folder / "p-1.obj");
    EXPECT_EQ(run({"simulate", plain, "-o", folder / "p-{frame}.obj"}).code, 4);
    EXPECT_FALSE(std::filesystem::exists(folder / "p-0.obj"));
}

TEST(SimulateCommand, writes_the_model_that_rods_carry)
{
    const Folder folder;
    folder.write("bar.obj", support::obj_text(support::long_bar()));
    const std::string scene = folder.write("bar.json", R"({"cellwarp": 1,
        "model": "bar.obj", "cells": {"across": 12}, "rods": [{"name": "spine",
        "through": [[0,0,0],[0,0,4]], "radius": 0.1, "carries": true,
        "fixed": [{"at": 0, "what": ["point", "tangent", "twist"]}]}],
        "bodies": [{"name": "stone", "mass": 1}],
        "simulate": {"dt": 0.01, "duration": 0.1, "every": 0.05}})");
    const std::string model = folder / "bar-{frame}.obj", rods = folder / "rods.ply";
    const Result result = run({"simulate", scene, "-o", model, "--rods", rods, "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    const nlohmann::json json = nlohmann::json::parse(result.out);
    EXPECT_FALSE(json["frames"][0].contains("model"));
    EXPECT_EQ(json["frames"][2]["model"]["stop"], "converged");
    EXPECT_GT(json["frames"][2]["model"]["cells"], 100);
    EXPECT_EQ(json["carriers"][0]["name"], "spine");
    EXPECT_GT(json["carriers"][0]["cells"], 8);
    const Geometry rest = read_geometry(folder / "bar.obj").geometry,
                   last = read_geometry(folder / "bar-2.obj").geometry;
    EXPECT_EQ(read_geometry(folder / "bar-0.obj").geometry.samples, rest.samples);
    ASSERT_EQ(last.samples.size(), rest.samples.size());
    EXPECT_EQ(last.corners, rest.corners);
    // It sags.
    double lowest = 0.0;
    for (std::size_t i = 0; i < rest.samples.size(); ++i)
        lowest = std::min(lowest, last.samples[i].y() - rest.samples[i].y());
    EXPECT_LT(lowest, -0.01);
    EXPECT_EQ(read_geometry(rods).geometry.samples.size() % 12, 0u);
    // Pictures have both; what deforms by frames alone has no time.
    if (support::can_run("render"))
    {
        EXPECT_EQ(run({"render", scene, "--strip=2", "--size", "40x30", "-o",
                       folder / "bar.png"})
                      .code,
                  0);
    }
    const Result deform = run({"deform", scene, "-o", folder / "no.obj"});
    EXPECT_EQ(deform.code, 3);
    EXPECT_TRUE(contains(deform.err, "rods: carry the model in time")) << deform.err;
    const std::string rope = folder.write("rope.json", kRope);
    EXPECT_EQ(run({"simulate", rope, "--rods", folder / "r.ply", "--json"}).code, 2);
    EXPECT_EQ(run({"simulate", scene, "-o", folder / "bar.stl"}).code, 2);
}

TEST(SimulateCommand, info_tells_of_what_moves_and_for_how_long)
{
    const Folder folder;
    const std::string scene = folder.write("rope.json", kRope);
    const std::string told = run({"info", scene}).out;
    EXPECT_TRUE(contains(told, "  rod in time rope, 2 points\n")) << told;
    EXPECT_TRUE(contains(told, "  in time     3 frames, 0.1 s\n")) << told;
    const std::string cloth = folder.write("cloth.json", R"({"cellwarp": 1, "rods": [],
        "sheets": [{"name": "flag", "corner": [0,0,0], "sides": [[1,0,0],[0,0,1]],
                    "fixed": [[0,0]], "counts": [5,6], "E": 1e5, "thickness": 0.002}],
        "nets": [{"name": "web", "points": [[0,0,0],[1,0,0]], "mass": 2,
                  "springs": [[0,1,100]]}],
        "simulate": {"dt": 0.01, "duration": 0.1, "every": 0.05}})");
    const Result result = run({"info", cloth});
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_TRUE(contains(result.out, "  sheet       flag, 5 x 6 control points\n"))
        << result.out;
    EXPECT_TRUE(contains(result.out, "  net         web, points: 2, springs: 1\n"))
        << result.out;
    const nlohmann::json json = nlohmann::json::parse(run({"info", cloth, "--json"}).out);
    EXPECT_EQ(json["time"]["frames"], 3);
    const std::string still = folder.write("still.json", R"({"cellwarp": 1,
        "model": "still.obj"})");
    folder.write("still.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    EXPECT_TRUE(
        nlohmann::json::parse(run({"info", still, "--json"}).out)["time"].is_null());
}

class SamplesOfRods : public testing::TestWithParam<std::string>
{
public:
    /// All that there are.
    static std::vector<std::string> names()
    {
        std::vector<std::string> found;
        for (const auto& entry :
             std::filesystem::directory_iterator(support::samples_folder() + "/rods"))
            if (entry.path().extension() == ".json")
                found.push_back(entry.path().stem());
        std::sort(found.begin(), found.end());
        return found;
    }
};

TEST_P(SamplesOfRods, converge)
{
    if (support::kIsSanitized && (GetParam() == "pile" || GetParam() == "intestine"))
        GTEST_SKIP() << "minutes there";
    const Result result =
        run({"simulate", support::samples_folder() + "/rods/" + GetParam() + ".json",
             "--json"});
    EXPECT_EQ(result.code, 0) << result.err;
}
INSTANTIATE_TEST_SUITE_P(All, SamplesOfRods, testing::ValuesIn(SamplesOfRods::names()),
                         [](const auto& sample) { return sample.param; });

TEST(SimulateCommand, its_scenes_are_drawn_frame_by_frame)
{
    if (!support::can_run("render"))
        GTEST_SKIP() << "this build draws none";
    const Folder folder;
    const std::string scene = folder.write("rope.json", kRope), png = folder / "rope.png";
    EXPECT_EQ(run({"render", scene, "--frame", "2", "--size", "40x30", "-o", png}).code,
              0);
    for (const auto& [flags, words] :
         {std::pair<std::vector<std::string>, std::string>{{"--cells"},
                                                           "--cells: rods have none"},
          {{"--frame", "3"}, "--frame: the scene has frames 0 to 2"}})
    {
        std::vector<std::string> all = {"render", scene, "-o", png, "--overwrite"};
        all.insert(all.end(), flags.begin(), flags.end());
        const Result result = run(all);
        EXPECT_EQ(result.code, 2);
        EXPECT_TRUE(contains(result.err, words)) << result.err;
    }
}

TEST(SimulateCommand, extreme_rods_end_in_a_documented_state)
{
    for (const char* only : {"rod-E1e9", "sliding"})
        support::expect_stable_extremes(only);
}

} // namespace cellwarp::core
