// SPDX-License-Identifier: GPL-3.0-or-later
// Skeletons as scripts see them: scenes that pose, cellwarp skeleton, files that move.
#include <algorithm>
#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/base/bytes.h"
#include "io/formats/geometry_file.h"
#include "octree/wrap/skeleton.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::Result;
using support::run;

namespace
{

using Json = nlohmann::json;

/// A bar along z with two bones, posed by two keys.
struct Files
{
    support::Folder folder;
    std::string model, scene;

    Files()
    {
        model = folder.write("bar.obj", support::obj_text(support::box_shape(
                                            {-0.5, -0.5, 0}, {0.5, 0.5, 4}, 4)));
        scene = folder.write("s.json", scene_text());
    }
    static std::string scene_text(const std::string& more = "")
    {
        return R"({"cellwarp": 1, "model": "bar.obj", "cells": {"across": 12, "max_depth": 0},
            "skeleton": {"joints": [
                {"name": "root", "parent": null, "at": [0, 0, 0]},
                {"name": "knee", "parent": "root", "at": [0, 0, 2]},
                {"name": "foot", "parent": "knee", "at": [0, 0, 4]}],
            "keys": [{"time": 0, "joint": "knee", "rotate": [1, 0, 0, 20]},
                     {"time": 2, "joint": "knee", "rotate": [1, 0, 0, 50]}])" +
               more + "}}";
    }
    std::string out(const std::string& name) const { return folder / name; }
};

} // namespace

TEST(SkeletonCli, keys_are_frames_and_json_tells_of_bones)
{
    const Files files;
    const Result result =
        run({"deform", files.scene, "-o", files.out("o-{frame}.obj"), "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const Json json = Json::parse(result.out);
    EXPECT_EQ(json["frames"].size(), 2u);
    EXPECT_EQ(json["skeleton"]["bones"].size(), 2u);
    EXPECT_GT(json["skeleton"]["bones"][1]["cells"], 3);
    EXPECT_EQ(json["skeleton"]["joints"][2]["name"], "foot");
    for (const auto& part : json["unused"])
        EXPECT_NE(part, "skeleton");
    EXPECT_TRUE(std::filesystem::exists(files.out("o-2.obj")));
    EXPECT_TRUE(contains(run({"check", files.scene}).out, "knee: holds"));
}

TEST(SkeletonCli, all_frames_go_into_one_file_that_moves)
{
    const Files files;
    for (const char* name : {"o.glb", "o.pc2", "o.mdd"})
    {
        const Result result = run({"deform", files.scene, "-o", files.out(name)});
        EXPECT_EQ(result.code, 0) << name << result.err;
        EXPECT_EQ(run({"deform", files.scene, "-o", files.out(name)}).code, 4);
    }
    // Two frames of 290 places.
    EXPECT_EQ(read_file(files.out("o.pc2")).size(), 32u + 2u * 290u * 12u);
    const GeometryFile glb = read_geometry(files.out("o.glb"));
    EXPECT_EQ(glb.geometry.samples.size(), 290u);
    EXPECT_TRUE(contains(read_file(files.out("o.glb")), "\"max\":[2]")); // the last time
    EXPECT_EQ(run({"deform", files.scene, "-o", files.out("o-{frame}.pc2")}).code, 2);
    EXPECT_EQ(run({"deform", files.model, "-o", files.out("n.pc2")}).code, 2);
}

TEST(SkeletonCli, blender_reads_the_frames_where_it_is_installed)
{
    const char* const blender = "/usr/bin/blender";
    if (!std::filesystem::exists(blender))
        GTEST_SKIP() << "there is no " << blender;
    const Files files;
    ASSERT_EQ(run({"deform", files.scene, "-o", files.out("o.glb")}).code, 0);
    const std::string script = files.folder.write(
        "look.py", "import numpy\n"
                   "numpy.bool = bool\n" // Debian 12's importer asks for it
                   "import bpy\n"
                   "bpy.ops.wm.read_factory_settings(use_empty=True)\n"
                   "bpy.ops.import_scene.gltf(filepath='" +
                       files.out("o.glb") +
                       "')\n"
                       "shape = [o for o in bpy.data.objects if o.type == 'MESH'][0]\n"
                       "print('SEEN', len(shape.data.vertices),"
                       " len(shape.data.shape_keys.key_blocks))\n");
    const Result seen = support::run_program(blender, {"-b", "--python", script});
    EXPECT_TRUE(contains(seen.out, "SEEN 290 3")) << seen.out << seen.err;
}

TEST(SkeletonCli, a_field_of_a_pose_applies_to_the_same_samples)
{
    const Files files;
    ASSERT_EQ(run({"deform", files.scene, "-o", files.out("o.obj"), "--save-field",
                   files.out("f.cwf")})
                  .code,
              0);
    ASSERT_EQ(
        run({"apply", files.out("f.cwf"), files.model, "-o", files.out("a.obj")}).code,
        0);
    const auto one = read_geometry(files.out("o.obj")).geometry.samples,
               other = read_geometry(files.out("a.obj")).geometry.samples;
    for (std::size_t i = 0; i < one.size(); ++i)
        EXPECT_LT((one[i] - other[i]).norm(), 1e-9);
}

TEST(SkeletonCli, what_contradicts_is_refused)
{
    const Files files;
    const std::string handles = files.folder.write(
        "h.handles", "cellwarp-handles 1\nframe 1\nmove knee rotate 1 0 0 30\n");
    Result result =
        run({"deform", files.scene, "--handles", handles, "-o", files.out("o.obj")});
    EXPECT_EQ(result.code, 3);
    EXPECT_TRUE(contains(result.err, "skeleton.keys: stand beside the frames of"));
    const std::string missing = files.folder.write(
        "m.json",
        R"({"cellwarp": 1, "model": "bar.obj", "skeleton": {"file": "no.bvh"}})");
    EXPECT_EQ(run({"check", missing}).code, 4);
    const std::string none = files.folder.write(
        "n.json", R"({"cellwarp": 1, "model": "bar.obj", "skeleton": {}})");
    EXPECT_EQ(run({"check", none}).code, 3);
    result = run(
        {"deform", files.scene, "-o", files.out("o.obj"), "--fix", "box 0 0 0 1 1 1"});
    EXPECT_EQ(result.code, 2);
    EXPECT_TRUE(contains(result.err, "do not know the skeleton of a scene"))
        << result.err;
    result = run({"skeleton", files.folder / "bar.obj", "-o", "-", "--json"});
    EXPECT_EQ(result.code, 2);
    EXPECT_TRUE(contains(result.err, "both need stdout")) << result.err;
}

TEST(SkeletonCli, a_handle_file_moves_the_joints_of_a_scene)
{
    const Files files;
    const std::string scene = files.folder.write(
        "h.json", R"({"cellwarp": 1, "model": "bar.obj", "handles": "h.handles",
            "cells": {"across": 12, "max_depth": 0}, "skeleton": {"file": "bar.tgf"}})");
    files.folder.write("bar.tgf", "1 0 0 0\n2 0 0 2\n3 0 0 4\n#\n1 2\n2 3\n");
    files.folder.write("h.handles",
                       "cellwarp-handles 1\nfixed foot box -1 -1 -1 1 1 0.2\n"
                       "frame 1\nmove 2 rotate 1 0 0 30\n");
    const Result result = run({"deform", scene, "-o", files.out("o.obj"), "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_NEAR(Json::parse(result.out)["skeleton"]["joints"][2]["at"][1], -1.0, 1e-9);
}

TEST(SkeletonCli, files_of_skeletons_that_cannot_be_written_are_told_first)
{
    const Files files;
    EXPECT_EQ(run({"skeleton", files.model, "-o", files.out("s.obj")}).code, 2);
    EXPECT_EQ(
        run({"skeleton", files.model, "-o", files.out("s.tgf"), "--bones", "0"}).code, 2);
    EXPECT_EQ(
        run({"skeleton", files.model, "-o", files.out("s.tgf"), "--bend", "0"}).code, 2);
    EXPECT_EQ(run({"skeleton", files.out("none.obj"), "-o", files.out("s.tgf")}).code, 4);
}

TEST(SkeletonCli, a_helper_that_is_missing_is_told_with_the_folder_looked_at)
{
    if (!has_curve_skeleton())
        GTEST_SKIP() << "this build finds none";
    const Files files;
    const support::Folder empty;
    const Result result = run({"skeleton", files.model, "-o", files.out("x.tgf")}, [&]
                              { ::setenv("CELLWARP_HELPERS", empty.path().c_str(), 1); });
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "cannot start cellwarp-skeleton, looked for in " +
                                         empty.path().string()))
        << result.err;
}

TEST(SkeletonCli, bones_of_what_should_swing_are_left_out)
{
    if (!has_curve_skeleton())
        GTEST_SKIP() << "this build finds none";
    const std::string model = support::samples_folder() + "/creature.obj";
    const support::Folder folder;
    const auto names = [&](std::vector<std::string> more)
    {
        std::vector<std::string> words = {"skeleton", model, "-o", "-"};
        words.insert(words.end(), more.begin(), more.end());
        const Result result = run(words);
        EXPECT_EQ(result.code, 0) << result.err;
        std::vector<std::string> out;
        const Json scene = Json::parse(result.out);
        for (const Json& joint : scene["skeleton"]["joints"])
            out.push_back(joint["name"].get<std::string>());
        return out;
    };
    const auto count = [](const std::vector<std::string>& all, const std::string& begin,
                          const std::string& end)
    {
        return std::count_if(all.begin(), all.end(),
                             [&](const std::string& name)
                             { return name.starts_with(begin) && name.ends_with(end); });
    };
    const std::vector<std::string> all = names({});
    EXPECT_GE(count(all, "leg.", ".L"), 3);
    EXPECT_EQ(count(all, "leg.", ".L"), count(all, "leg.", ".R"));
    EXPECT_EQ(count(all, "arm.", ".L"), count(all, "arm.", ".R"));
    const std::vector<std::string> one_leg = names({"--without", "leg.L"});
    EXPECT_EQ(count(one_leg, "leg.", ".L"), 0);
    EXPECT_EQ(count(one_leg, "leg.", ".R"), count(all, "leg.", ".R"));
    EXPECT_EQ(count(names({"--without", "leg"}), "leg", ""), 0);
    EXPECT_EQ(count(names({"--soft", "arm"}), "arm.1", ""), 2);
    EXPECT_EQ(count(names({"--soft", "arm"}), "arm.2", ""), 0);
    EXPECT_EQ(count(names({"--without", "leg.2.R"}), "leg.", ".R"), 1);
    EXPECT_EQ(count(names({"--soft", "leg.2.R"}), "leg.", ".R"), 2);
    Result result = run({"skeleton", model, "-o", "-", "--without", "wing"});
    EXPECT_EQ(result.code, 2);
    EXPECT_TRUE(contains(result.err, "'wing', which is neither a joint nor a limb"));
    result = run({"skeleton", model, "-o", "-", "--soft", "root"});
    EXPECT_EQ(result.code, 2);
    EXPECT_TRUE(contains(result.err, "the root cannot be left out"));
}

TEST(SkeletonCli, a_capture_moves_joints_that_were_found)
{
    const std::string model = support::samples_folder() + "/creature.obj";
    const support::Folder folder;
    folder.write("nod.bvh",
                 "HIERARCHY\nROOT Hips\n{\nOFFSET 0 1 0\n"
                 "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation "
                 "Yrotation\n"
                 "JOINT Spine\n{\nOFFSET 0 0.5 0\nCHANNELS 3 Zrotation Xrotation "
                 "Yrotation\nEnd Site\n{\nOFFSET 0 0.5 0\n}\n}\n"
                 "JOINT LLeg\n{\nOFFSET 0.1 -0.1 0\nCHANNELS 3 Zrotation Xrotation "
                 "Yrotation\nEnd Site\n{\nOFFSET 0 -0.9 0\n}\n}\n"
                 "JOINT RLeg\n{\nOFFSET -0.1 -0.1 0\nCHANNELS 3 Zrotation Xrotation "
                 "Yrotation\nEnd Site\n{\nOFFSET 0 -0.9 0\n}\n}\n}\n"
                 "MOTION\nFrames: 2\nFrame Time: 0.5\n"
                 "0 1 0 0 0 0 0 0 0 0 0 0 0 0 0\n"
                 "0 1 0 0 0 0 0 0 0 0 -40 0 0 0 0\n");
    const std::string scene =
        folder.write("s.json", R"({"cellwarp": 1, "model": ")" + model +
                                   R"(", "cells": {"max_depth": 0},
            "skeleton": {"motion": {"file": "nod.bvh"}, "joints": [
                {"name": "root", "parent": null, "at": [0, 1, 0]},
                {"name": "head", "parent": "root", "at": [0, 2, 0]},
                {"name": "leg.L", "parent": "root", "at": [0.2, 0.1, 0]},
                {"name": "leg.R", "parent": "root", "at": [-0.2, 0.1, 0]}]}})");
    const Result result = run({"check", scene});
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_TRUE(contains(result.out, "2 frames")) << result.out;
    const std::string both =
        folder.write("b.json", R"({"cellwarp": 1, "model": ")" + model + R"(",
            "skeleton": {"motion": {"file": "nod.tgf"}, "joints": [
                {"name": "root", "parent": null, "at": [0, 1, 0]}]}})");
    const Result refused = run({"check", both});
    EXPECT_EQ(refused.code, 3);
    EXPECT_TRUE(contains(refused.err, "skeleton.motion.file: got 'nod.tgf'"))
        << refused.err;
}

TEST(SkeletonCli, info_tells_where_limbs_end)
{
    if (!has_curve_skeleton())
        GTEST_SKIP() << "this build finds none";
    const std::string model = support::samples_folder() + "/creature.obj";
    const support::Folder folder;
    const Result told = run({"info", "--extremities", "--json", model});
    ASSERT_EQ(told.code, 0) << told.err;
    const Json ends = Json::parse(told.out)["extremities"];
    int hands = 0, feet = 0, tails = 0;
    for (const Json& end : ends)
    {
        EXPECT_GT(end["samples"], 10);
        const Json &low = end["relative_box"][0], &high = end["relative_box"][1];
        hands += (low[0] == 0.0 && high[0] < 0.2) || (low[0] > 0.8 && high[0] == 1.0);
        feet += low[1] == 0.0 && high[1] < 0.2;
        tails += low[2] == 0.0 && high[2] < 0.3;
    }
    EXPECT_EQ(hands, 2);
    EXPECT_EQ(feet, 2);
    EXPECT_EQ(tails, 1);
    EXPECT_TRUE(
        contains(run({"info", "--extremities", model}).out, "  extremity   box 0 0."));
    // Halves of a bar are no limbs.
    const Result bar =
        run({"info", "--extremities", support::samples_folder() + "/bar.obj"});
    EXPECT_EQ(bar.code, 0) << bar.err;
    EXPECT_TRUE(contains(bar.out, "  extremity   none: every limb")) << bar.out;
    const std::string point = folder.write("point.obj", "v 1 2 3\n");
    EXPECT_EQ(run({"info", "--extremities", point}).code, 6);
}

} // namespace cellwarp::core
