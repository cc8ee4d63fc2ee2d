// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/scene_file.h"

#include <gtest/gtest.h>

#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

std::string refused(const std::string& text)
{
    return error_of(Fault::Malformed, [&] { parse_scene("s.json", text); });
}

std::string with(const std::string& more)
{
    return R"({"cellwarp": 1, "model": "a.obj", )" + more + "}";
}

} // namespace

TEST(SceneFile, reads_every_key)
{
    const SceneFile scene = parse_scene("dir/s.json", R"({
        "cellwarp": 1, "model": "a.obj", "handles": "/b.handles",
        "energy": "botsch07",
        "cells": {"fill": "shell", "across": 20, "max_depth": 2, "threshold": 0.01,
                  "gap": 0.02, "thickness": 0.03, "loose": "stay", "join": true, "contact": true, "max_cells": 5000,
                  "frame": {"origin": [1, 2, 3], "axes": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
                            "size": [4, 5, 0]}},
        "field": {"drag": "closest4", "release": "rbf-global"}})");
    EXPECT_EQ(scene.model, "dir/a.obj");
    EXPECT_EQ(scene.handles, "/b.handles");
    EXPECT_EQ(scene.settings.energy, "botsch07");
    EXPECT_EQ(scene.settings.cells.fill, "shell");
    EXPECT_EQ(scene.settings.cells.across, 20);
    EXPECT_EQ(scene.settings.cells.max_depth, 2);
    EXPECT_EQ(scene.settings.cells.threshold, 0.01);
    EXPECT_EQ(scene.settings.cells.gap, 0.02);
    EXPECT_EQ(scene.settings.cells.thickness, 0.03);
    EXPECT_EQ(scene.settings.cells.loose, "stay");
    EXPECT_EQ(scene.settings.cells.join, true);
    EXPECT_EQ(scene.settings.cells.contact, true);
    EXPECT_EQ(scene.settings.cells.max_cells, 5000);
    ASSERT_TRUE(scene.frame);
    EXPECT_EQ(scene.frame->axes[1][0], -1.0);
    EXPECT_EQ(scene.settings.field.drag, "closest4");
    EXPECT_EQ(scene.settings.field.release, "rbf-global");
    EXPECT_TRUE(scene.warnings.empty());
}

TEST(SceneFile, what_is_for_simulate_is_left_to_it)
{
    const SceneFile scene = parse_scene(
        "s.json",
        R"({"cellwarp": 1, "model": "m.obj", "rods": [{"points": [[0,0,0],[1,0,0]]}], "simulate": {"dt": 1}})");
    ASSERT_EQ(scene.left_out.size(), 2u);
    for (const std::string& warning : scene.left_out)
        EXPECT_TRUE(contains(warning, "is for cellwarp simulate, ignored")) << warning;
}

TEST(SceneFile, a_scene_that_moves_to_another_folder_names_the_same_files)
{
    const std::string text = with(R"("obstacles": [{"mesh": "wall.obj"}],
        "skeleton": {"file": "walk.glb", "animation_file": "more.glb",
            "law": "regions", "weights": "/home/w.txt", "lattice": "sub/l.mesh",
            "motion": {"file": "run.bvh"}}, "mine": "kept.txt")");
    const std::string moved =
        moved_scene_text(parse_scene("there/s.json", text), "here/t.json");
    for (const char* name :
         {R"("mesh": "../there/wall.obj")", R"("file": "../there/walk.glb")",
          R"("animation_file": "../there/more.glb")", R"("weights": "/home/w.txt")",
          R"("lattice": "../there/sub/l.mesh")", R"("file": "../there/run.bvh")",
          R"("mine": "kept.txt")"})
        EXPECT_TRUE(contains(moved, name)) << name << moved;
    EXPECT_EQ(moved_scene_text(parse_scene("a/s.json", text), "a/s.json"), text);
    const std::string octree =
        with(R"("skeleton": {"file": "a.tgf", "lattice": "octree"})");
    EXPECT_TRUE(contains(moved_scene_text(parse_scene("a/s.json", octree), "b/s.json"),
                         R"("lattice": "octree")"));
}

TEST(SceneFile, unknown_keys_are_named_in_warnings)
{
    const SceneFile scene = parse_scene(
        "s.json", with(R"("colour": 3, "cells": {"acros": 3}, "field": {"x": 1})"));
    ASSERT_EQ(scene.warnings.size(), 3u);
    EXPECT_TRUE(contains(scene.warnings[0], "cells.acros"));
}

TEST(SceneFile, names_the_line_or_the_key_of_what_is_wrong)
{
    EXPECT_TRUE(contains(refused("{\n\"cellwarp\": 1,\n,}"), "s.json:3"));
    EXPECT_TRUE(contains(refused(""), "no JSON"));
    EXPECT_TRUE(contains(refused("[]"), "object"));
    EXPECT_TRUE(contains(refused(R"({"model": "a.obj"})"), "cellwarp"));
    EXPECT_TRUE(
        contains(refused(R"({"cellwarp": 2, "model": "a.obj"})"), "made by version 2"));
    EXPECT_TRUE(contains(refused(R"({"cellwarp": 1})"), "s.json: model: is missing"));
    EXPECT_TRUE(contains(refused(R"({"cellwarp": 1, "model": 3})"),
                         "s.json:1: model: need a text"));
    EXPECT_TRUE(contains(refused(with(R"("cells": {"gap": -1})")), "cells.gap"));
    EXPECT_TRUE(contains(refused(with(R"("cells": {"gap": "x"})")), "cells.gap"));
    EXPECT_TRUE(contains(refused(with(R"("cells": {"loose": "go"})")), "cells.loose"));
    EXPECT_TRUE(contains(refused(with(R"("cells": {"join": 1})")),
                         "cells.join: got 1, need true or false"));
    EXPECT_TRUE(
        contains(refused(with(R"("cells": {"threshold": -0.1})")), "cells.threshold"));
    EXPECT_TRUE(
        contains(refused(with(R"("cells": {"threshold": 1e999})")), "out of range"));
    EXPECT_TRUE(
        contains(refused(with(R"("cells": {"max_depth": 21})")), "cells.max_depth"));
    EXPECT_TRUE(
        contains(refused(with(R"("cells": {"max_depth": 1.5})")), "cells.max_depth"));
    EXPECT_TRUE(contains(refused(with(R"("cells": {"across": 0})")), "cells.across"));
    EXPECT_TRUE(contains(refused(with(R"("cells": {"fill": "foam"})")), "cells.fill"));
    EXPECT_TRUE(
        contains(refused(with(R"("cells": {"frame": {"origin": [0, 0, 0]}})")), "size"));
    EXPECT_TRUE(contains(
        refused(with(R"("cells": {"frame": {"origin": [0, 0], "size": [1, 1, 1]}})")),
        "origin"));
    for (const char* axes : {"3", "[[1, 0, 0], [0, 1, 0]]"})
        EXPECT_TRUE(contains(
            refused(with(
                R"("cells": {"frame": {"origin": [0, 0, 0], "size": [1, 1, 1], "axes": )" +
                std::string(axes) + "}}")),
            "s.json:1: cells.frame.axes: need three vectors"));
    EXPECT_TRUE(contains(
        refused(
            with(R"("cells": {"frame": {"origin": [0, "x", 0], "size": [1, 1, 1]}})")),
        "s.json:1: cells.frame.origin: need three finite numbers"));
    for (const char* size : {"[1, -1, 1]", "[0, 0, 0]"})
        EXPECT_TRUE(
            contains(refused(with(R"("cells": {"frame": {"origin": [0, 0, 0], "size": )" +
                                  std::string(size) + "}}")),
                     "s.json:1: cells.frame.size: need lengths >= 0, not all of them 0"));
    EXPECT_TRUE(
        contains(refused(with(R"("field": {"release": "cubic"})")), "field.release"));
    EXPECT_TRUE(contains(refused(std::string(100000, '[')), "deeper than 128"));
}

TEST(SceneFile, what_is_wrong_is_told_with_its_line)
{
    const std::string head = "{\n  \"cellwarp\": 1,\n  \"model\": \"m.obj\",\n";
    EXPECT_TRUE(contains(refused(head + "  \"cells\": {\n    \"across\": \"many\"}}"),
                         "s.json:5: cells.across: got "));
    // A key that is not there, by the object that should have it.
    EXPECT_TRUE(contains(
        refused(
            head +
            "  \"skeleton\": {\"joints\": [\n    {\"name\": \"a\", \"at\": [0,0,0]},\n"
            "    {\"name\": \"b\"}\n  ]}}"),
        "s.json:6: skeleton.joints[1]."));
    EXPECT_TRUE(contains(refused("\n{\"cellwarp\": 1}"), "s.json: model: is missing"));
    // A name with escapes is the same name.
    EXPECT_TRUE(contains(refused(head + "\n\"c\\u0065lls\": {\n\"gap\": {}}}"),
                         "s.json:6: cells.gap: got "));
    EXPECT_TRUE(contains(refused(head + "  \"field\": [\n1]}"), "s.json:4: field: need"));
}

TEST(SceneFile, a_key_that_is_there_twice_is_warned_of_with_its_line)
{
    const auto warnings = [](const std::string& text)
    { return parse_scene("s.json", text).warnings; };
    const std::string says = ": is in its object more than once: the last value counts";
    const std::string text = "{\"cellwarp\": 1, \"model\": \"a.obj\",\n\"cells\": {\n"
                             "\"across\": 9, \"across\": 7}}";
    EXPECT_EQ(warnings(text),
              (std::vector<std::string>{"s.json:3: cells.across" + says}));
    EXPECT_EQ(parse_scene("s.json", text).settings.cells.across, 7);
    EXPECT_TRUE(contains(warnings(with(R"("cells": {}, "\u0063ells": {})")).at(0),
                         "cells" + says));
    EXPECT_TRUE(contains(refused(R"({"a": 1, "a": 1, )"), "is no JSON"));
    // The same key of two objects is no such thing.
    const std::string apart = with(R"("note": [{"a": 1}, {"a": [1, {"a": 2}]}],
                                      "more": {"note": {"a": [1, 2]}})");
    for (const std::string& warning : warnings(apart))
        EXPECT_FALSE(contains(warning, says)) << warning;
}

} // namespace cellwarp::core
