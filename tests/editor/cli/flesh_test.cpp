// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp simulate with flesh, from the outside.
#include <algorithm>
#include <bit>
#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/formats/geometry_file.h"
#include "tests/support/extremes.h"
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

struct Files
{
    support::Folder folder;
    std::string scene;

    explicit Files(const std::string& more = "", const std::string& key = "60")
    {
        folder.write("bar.obj", support::obj_text(support::box_shape({-0.5, -0.5, 0},
                                                                     {0.5, 0.5, 4}, 4)));
        scene =
            folder.write("s.json",
                         R"({"cellwarp": 1, "model": "bar.obj", "skeleton": {"joints": [
                {"name": "root", "parent": null, "at": [0, 0, 0]},
                {"name": "knee", "parent": "root", "at": [0, 0, 2]},
                {"name": "foot", "parent": "knee", "at": [0, 0, 4]}],
              "keys": [{"time": 0, "joint": "knee", "rotate": [1, 0, 0, 0]},
                       {"time": 0.2, "joint": "knee", "rotate": [1, 0, 0, )" +
                             key + R"(]}],
              "E": 2e4, "across": 8)" +
                             more + R"(}, "simulate": {"duration": 0.2}})");
    }
};

} // namespace

TEST(SimulateFlesh, a_warning_of_the_skeletons_file_is_shown_once)
{
    const Files files;
    files.folder.write("rig.gltf",
                       R"({"asset": {"version": "2.0"}, "skins": [{"joints": [0, 1]}],
        "nodes": [{"name": "root", "children": [1], "scale": [1.004, 1, 1]},
                  {"name": "foot", "translation": [0, 0, 4]}]})");
    const std::string scene = files.folder.write(
        "rig.json", R"({"cellwarp": 1, "model": "bar.obj", "simulate": {"duration": 0.02},
                        "skeleton": {"file": "rig.gltf", "E": 1e6}})");
    for (const char* command : {"check", "simulate"})
    {
        std::vector<std::string> arguments{command, scene, "--json"};
        if (arguments[0] == "simulate")
            arguments.insert(arguments.end(), {"-o", files.folder / "out.obj"});
        const Result result = run(arguments);
        ASSERT_EQ(result.code, 0) << result.err;
        const std::vector<std::string> warnings = Json::parse(result.out)["warnings"];
        EXPECT_EQ(std::count_if(warnings.begin(), warnings.end(),
                                [](const std::string& warning)
                                { return contains(warning, "scales joints by up to"); }),
                  1)
            << command << result.out;
    }
}

TEST(SimulateFlesh, writes_frames_and_tells_of_them)
{
    const Files files(R"(, "rest": "as-drawn")");
    const Result result =
        run({"simulate", files.scene, "-o", files.folder / "b-{frame:02}.obj", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const Json json = Json::parse(result.out);
    ASSERT_EQ(json["frames"].size(), 7u);
    EXPECT_EQ(json["steps"], 24);
    const Json& last = json["frames"][6];
    EXPECT_EQ(last["frame"], 6);
    EXPECT_NEAR(last["time"].get<double>(), 0.2, 1e-12);
    EXPECT_EQ(last["stop"], "converged");
    EXPECT_LT(last["constraint"].get<double>(), 1e-12);
    EXPECT_EQ(last["rods"].size(), 0u);
    for (const char* key : {"elastic", "kinetic", "largest_strain", "nodes", "free_nodes",
                            "cg_steps", "rows_dropped"})
        EXPECT_TRUE(last["skeleton"].contains(key)) << key;
    EXPECT_GT(last["energy"]["elastic"].get<double>(), 0.0);
    EXPECT_GT(last["skeleton"]["largest_strain"].get<double>(), 0.01);
    EXPECT_NEAR(last["volume"]["before"].get<double>(), 4.0, 1e-9);
    EXPECT_NEAR(json["mass"].get<double>(), 4000.0, 1e-6);
    const Json unused = json["unused"];
    EXPECT_EQ(std::count(unused.begin(), unused.end(), "skeleton"), 0);
    EXPECT_EQ(std::count(unused.begin(), unused.end(), "rods"), 1);
    // Frame 0 is the model at rest, byte by byte; the last has the tip turned.
    EXPECT_EQ(support::bytes_of(files.folder / "b-00.obj"),
              support::bytes_of(files.folder / "bar.obj"));
    const Geometry bent = read_geometry(files.folder / "b-06.obj").geometry;
    double lowest = 0.0;
    for (const Eigen::Vector3d& x : bent.samples)
        lowest = std::min(lowest, x.y());
    EXPECT_LT(lowest, -1.0);
}

TEST(SimulateFlesh, gives_the_same_bytes_for_any_number_of_threads)
{
    const Files files;
    for (const char* threads : {"1", "2"})
        ASSERT_EQ(run({"simulate", files.scene, "-o",
                       files.folder / (std::string("t") + threads + ".obj"), "--threads",
                       threads})
                      .code,
                  0);
    EXPECT_EQ(support::bytes_of(files.folder / "t1.obj"),
              support::bytes_of(files.folder / "t2.obj"));
}

TEST(SimulateFlesh, writes_all_frames_as_one_file_that_moves)
{
    const Files files;
    for (const char* name : {"b.glb", "b.pc2", "b.mdd"})
    {
        const std::string out = files.folder / name;
        const Result result = run({"simulate", files.scene, "-o", out});
        EXPECT_EQ(result.code, 0) << result.err;
        EXPECT_GT(std::filesystem::file_size(out), 1000u);
    }
    const std::string pc2 = support::bytes_of(files.folder / "b.pc2");
    std::int32_t frames = 0;
    std::memcpy(&frames, pc2.data() + 28, 4);
    EXPECT_EQ(frames, 7);
    const Result result =
        run({"simulate", files.scene, "-o", files.folder / "b{frame}.mdd"});
    EXPECT_EQ(result.code, 2);
    EXPECT_TRUE(contains(result.err, "leave out {frame}"));
}

TEST(SimulateFlesh, tight_solves_the_systems_to_the_last)
{
    const Files files;
    const auto cg_steps = [&](const std::vector<std::string>& more)
    {
        std::vector<std::string> arguments = {"simulate", files.scene, "--json"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 0) << result.err;
        return Json::parse(result.out)["frames"][6]["skeleton"]["cg_steps"].get<int>();
    };
    EXPECT_GT(cg_steps({"--tight"}), 2 * cg_steps({}));
}

TEST(SimulateFlesh, what_is_not_built_and_what_cannot_be_is_refused)
{
    const Result law = run({"simulate", Files(R"(, "law": "plastic")").scene, "--json"});
    EXPECT_EQ(law.code, 3);
    EXPECT_EQ(Json::parse(law.out)["error"]["field"], "skeleton.law");
    EXPECT_TRUE(contains(law.err, "skeleton.law: got 'plastic'"));
    const Result lattice =
        run({"simulate", Files(R"(, "lattice": "none.mesh")").scene, "--json"});
    EXPECT_EQ(lattice.code, 4);
    const Files files;
    EXPECT_EQ(run({"simulate", files.scene, "-o", files.folder / "x.ply"}).code, 2);
    const Result rods = run({"simulate", files.scene, "--rods", files.folder / "r.obj"});
    EXPECT_EQ(rods.code, 2);
    EXPECT_TRUE(contains(rods.err, "the scene has no rods"));
}

TEST(SimulateFlesh, the_same_scene_poses_cells_when_it_is_deformed)
{
    const Files files;
    const Result result = run({"deform", files.scene, "-o", files.folder / "posed.obj",
                               "--json", "--max-depth", "0"});
    ASSERT_EQ(result.code, 0) << result.err;
    const Json json = Json::parse(result.out);
    EXPECT_EQ(json["frames"].size(), 2u);
    EXPECT_TRUE(contains(json["warnings"].dump(), "skeleton.E"));
}

TEST(SimulateFlesh, check_tells_of_the_flesh_and_refuses_what_simulate_refuses)
{
    const Files files;
    const Result result = run({"check", files.scene, "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const Json json = Json::parse(result.out);
    EXPECT_EQ(json["warnings"].size(), 0u) << json["warnings"].dump();
    EXPECT_NEAR(json["flesh"]["mass"].get<double>(), 4000.0, 1e-6);
    EXPECT_GT(json["flesh"]["free_nodes"].get<int>(), 0);
    EXPECT_TRUE(contains(run({"check", files.scene}).out, " points on bones, 4000 kg"));
    for (const auto& [more, code] :
         {std::pair{R"(, "law": "regions", "newton": 2)", 3},
          {R"(, "weights": "w.txt")", 3},
          {R"(, "law": "regions", "weights": "w.txt")", 4},
          {R"(, "held": [{"at": [9, 9, 9]}])", 3},
          {R"(, "lattice": "none.mesh")", 4},
          {R"(, "max_depth": 12)", 5},
          {R"(, "materials": [{"region": "box 9 9 9 10 10 10"}])", 3}})
    {
        const Files refused(more);
        const Result check = run({"check", refused.scene});
        EXPECT_EQ(check.code, code) << more;
        EXPECT_EQ(run({"simulate", refused.scene, "--json"}).err, check.err);
        EXPECT_TRUE(contains(check.err, "skeleton.") || code == 4) << check.err;
    }
}

namespace
{

/// The bar with joints alone, moved by a handle file or by keys.
struct Played
{
    Files files;
    std::string scene;

    explicit Played(const std::string& handles, const std::string& keys = "",
                    const std::string& duration = "0.2")
    {
        if (!handles.empty())
            files.folder.write("b.handles", "cellwarp-handles 1\n" + handles);
        scene = files.folder.write(
            "played.json",
            R"({"cellwarp": 1, "model": "bar.obj", "skeleton": {"joints": [
                {"name": "root", "parent": null, "at": [0, 0, 0]},
                {"name": "knee", "parent": "root", "at": [0, 0, 2]},
                {"name": "foot", "parent": "knee", "at": [0, 0, 4]}],
              "E": 2e4, "across": 8)" +
                keys + R"(}, "simulate": {"duration": )" + duration + "}" +
                (handles.empty() ? "" : R"(, "handles": "b.handles")") + "}");
    }
    /// The end of the bar's axis in each frame.
    std::vector<Eigen::Vector3d> tips(const std::string& threads = "1") const
    {
        const Result result = run({"simulate", scene, "-o", files.folder / "p{frame}.obj",
                                   "--json", "--overwrite", "--threads", threads});
        EXPECT_EQ(result.code, 0) << result.err;
        const Geometry rest = read_geometry(files.folder / "bar.obj").geometry;
        std::vector<Eigen::Vector3d> tips;
        const std::size_t count = Json::parse(result.out)["frames"].size();
        for (std::size_t frame = 0; frame < count; ++frame)
        {
            const Geometry now =
                read_geometry(files.folder / "p" + std::to_string(frame) + ".obj")
                    .geometry;
            for (std::size_t i = 0; i < rest.samples.size(); ++i)
                if ((rest.samples[i] - Eigen::Vector3d(0, 0, 4)).norm() < 1e-9)
                    tips.push_back(now.samples[i]);
        }
        EXPECT_EQ(tips.size(), count);
        return tips;
    }
};

} // namespace

TEST(SimulateFlesh, frames_of_a_handle_file_are_played)
{
    const std::string frames = "frame 3\nmove foot to 0 2 2\nframe 6\n"
                               "move root translate 0 0.2 0\n";
    const Played played(frames);
    const std::vector<Eigen::Vector3d> tips = played.tips();
    ASSERT_EQ(tips.size(), 7u);
    EXPECT_LT((tips[0] - Eigen::Vector3d(0, 0, 4)).norm(), 1e-12);
    for (const int frame : {3, 4, 5, 6}) // it is held there
        EXPECT_LT(
            (tips[static_cast<std::size_t>(frame)] - Eigen::Vector3d(0, 2, 2)).norm(),
            1e-6)
            << frame;
    // A shorter run is the beginning of a longer one, for any number of threads.
    const std::string third = support::bytes_of(played.files.folder / "p3.obj");
    const Played shorter(frames, "", "0.1");
    shorter.tips("2");
    EXPECT_EQ(support::bytes_of(shorter.files.folder / "p3.obj"), third);
    const Result check = run({"check", played.scene});
    EXPECT_EQ(check.code, 0) << check.err;
    EXPECT_TRUE(contains(check.out, "2 frames: in order"));
}

TEST(SimulateFlesh, a_joint_reaches_the_places_of_its_keys)
{
    const Played played("", R"(, "keys": [
        {"time": 0, "joint": "foot", "to": [0, 0, 4]},
        {"time": 0.1, "joint": "foot", "to": [0, 2, 2]}])");
    const std::vector<Eigen::Vector3d> tips = played.tips();
    for (std::size_t frame = 0; frame < tips.size(); ++frame)
    {
        const double share = std::min(1.0, static_cast<double>(frame) / 3.0);
        EXPECT_LT((tips[frame] - Eigen::Vector3d(0, 2 * share, 4 - 2 * share)).norm(),
                  1e-6)
            << frame;
    }
    // deform has the poses at the keys.
    const Result deform = run({"deform", played.scene, "-o",
                               played.files.folder / "d{frame}.obj", "--overwrite"});
    EXPECT_EQ(deform.code, 0) << deform.err;
    const Played far("", R"(, "keys": [{"time": 0, "joint": "foot", "to": [0, 9, 0]}])");
    const Result warned = run({"simulate", far.scene, "--json"});
    EXPECT_EQ(warned.code, 0) << warned.err;
    EXPECT_TRUE(contains(Json::parse(warned.out)["warnings"].dump(),
                         "skeleton.keys[0]: joint foot ends up to"));
}

TEST(SimulateFlesh, statements_that_cannot_be_played_are_refused)
{
    for (const char* handles :
         {"fixed base box -1 -1 -1 1 1 0.5\nframe 1\n",
          "handle top box -1 -1 3 1 1 5\nframe 1\nmove top translate 0 1 0\n",
          "stiff s box -1 -1 3 1 1 5 20\n",
          "rod r through 0 0 0 0 0 4 radius 0.1\nframe 1\nmove r translate 0 1 0\n"})
    {
        const Played played(handles);
        const Result result = run({"simulate", played.scene, "--json"});
        EXPECT_EQ(result.code, 3) << handles;
        EXPECT_TRUE(contains(result.err, "b.handles:2: ")) << result.err;
        EXPECT_TRUE(contains(result.err, "cannot be played by simulate"));
        const Result check = run({"check", played.scene, "--json"});
        EXPECT_EQ(check.code, 3);
        EXPECT_EQ(check.err, result.err);
    }
}

TEST(SimulateFlesh, does_not_wait_for_what_falls_without_end_to_come_to_rest)
{
    const Files files;
    const std::string scene = files.folder.write(
        "loose.json", R"({"cellwarp": 1, "model": "bar.obj", "skeleton": {"joints": [
            {"name": "root", "parent": null, "at": [9, 0, 0]},
            {"name": "tip", "parent": "root", "at": [9, 0, 2]}],
          "across": 8, "settle": true}, "simulate": {"duration": 0.1, "viscosity": 1}})");
    const Result result = run({"simulate", scene, "--json"});
    EXPECT_EQ(result.code, 3);
    EXPECT_TRUE(contains(result.err, "skeleton.settle: 1 of 1 parts")) << result.err;
}

TEST(SimulateFlesh, warns_of_what_it_does_not_use_and_of_cells_inside_out)
{
    const Files files(R"(, "E": 50)", "179");
    std::string text = support::bytes_of(files.scene);
    text.replace(text.find("\"duration\": 0.2"), 15,
                 R"("duration": 0.2, "viscosity": 2)");
    files.folder.write("s.json", text);
    const Result result = run({"simulate", files.scene, "--json"});
    const Json json = Json::parse(result.out);
    const std::string warnings = json["warnings"].dump();
    EXPECT_TRUE(contains(warnings, "simulate.viscosity: is for rods")) << warnings;
    int inverted = 0;
    for (const Json& frame : json["frames"])
        inverted = std::max(inverted, frame["skeleton"]["inverted"].get<int>());
    EXPECT_GT(inverted, 0);
    EXPECT_TRUE(contains(warnings, "were turned inside out")) << warnings;
}

TEST(SimulateFlesh, the_last_frame_of_a_file_that_moves_has_its_own_time)
{
    const Files files;
    std::string text = support::bytes_of(files.scene);
    text.replace(text.find("\"duration\": 0.2"), 15, R"("duration": 0.05, "every": 10)");
    files.folder.write("s.json", text);
    const std::string out = files.folder / "b.mdd";
    ASSERT_EQ(run({"simulate", files.scene, "-o", out}).code, 0);
    // Two times as big-endian floats: 0, 0.05.
    const std::string mdd = support::bytes_of(out);
    std::uint32_t bits = 0;
    for (std::size_t k = 12; k < 16; ++k)
        bits = bits << 8 | static_cast<unsigned char>(mdd[k]);
    EXPECT_NEAR(std::bit_cast<float>(bits), 0.05, 1e-6);
}

TEST(SimulateFlesh, far_and_fast_keys_end_in_a_documented_state)
{
    for (const char* key : {"180", "179.999999", "1e6"})
        for (const char* more :
             {"", R"(, "nu": 0.4999)", R"(, "E": 1e-3)", R"(, "E": 1e12)"})
        {
            const Result result = run({"simulate", Files(more, key).scene, "--json"});
            EXPECT_TRUE(result.code == 0 || result.code == 7)
                << result.code << result.err;
            const Json json = Json::parse(result.out);
            EXPECT_LT(json["frames"][6]["constraint"].get<double>(), 1e-9);
        }
}

TEST(SimulateFlesh, extreme_flesh_ends_in_a_documented_state)
{
    for (const char* only : {"flesh-nu0.4999", "flesh-E"})
        support::expect_stable_extremes(only);
}

} // namespace cellwarp::core
