// SPDX-License-Identifier: GPL-3.0-or-later
// Subcommands, flags, exit codes and what they print.
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/base/bytes.h"
#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "octree/wrap/triangle_pair.h"
#include "tests/support/files.h"
#include "tests/support/pot.h"
#include "tests/support/program.h"
#include "tests/support/sanitized.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::num_files;
using support::Result;
using support::run;
using Files = support::BarFiles;

TEST(Cli, help_and_version_are_there)
{
    for (const char* command : {"deform", "apply", "info", "check"})
    {
        const Result result = run({command, "--help"});
        EXPECT_EQ(result.code, 0);
        EXPECT_TRUE(contains(result.out, std::string("  cellwarp ") + command));
        EXPECT_LT(result.out.find("  cellwarp "), result.out.find("Usage"));
        EXPECT_TRUE(contains(result.out, "--overwrite")) << command;
    }
    for (const char* command : {"deform", "check", "sweep"})
        EXPECT_TRUE(contains(run({command, "--help"}).out, "about border]")) << command;
    EXPECT_EQ(run({"--help"}).code, 0);
    EXPECT_TRUE(contains(run({"--version"}).out, "cellwarp 0."));
}

TEST(Cli, arguments_that_are_nearly_right_are_told_what_was_meant)
{
    const Files files;
    EXPECT_TRUE(contains(run({"deform", files.model, files.handles, "-o", files.out}).err,
                         "did you mean --handles " + files.handles + "?"));
    const Result typed =
        run({"deform", files.model, "--handels", files.handles, "-o", files.out});
    EXPECT_EQ(typed.code, 2);
    EXPECT_TRUE(contains(typed.err, "did you mean --handles?"));
    EXPECT_TRUE(contains(run({"deform", files.model, "--overwite", "-o", files.out}).err,
                         "did you mean --overwrite?"));
    EXPECT_FALSE(contains(run({"deform", files.model, "--xyzzy", "-o", files.out}).err,
                          "did you mean"));
    const Result command = run({"defrom", files.model});
    EXPECT_EQ(command.code, 2);
    EXPECT_TRUE(contains(command.err, "'defrom' (did you mean deform?)")) << command.err;
    EXPECT_FALSE(contains(run({"xyzzy"}).err, "did you mean"));
    const Result key =
        run({"check", files.folder.write("key.json", "{\"cellwarp\": 1, \"modle\": "
                                                     "\"bar.obj\"}")});
    EXPECT_EQ(key.code, 3);
    EXPECT_TRUE(contains(key.err, "key.json: model: is missing (there is 'modle')"))
        << key.err;
    EXPECT_TRUE(contains(
        run({"check", files.folder.write("no.json", R"({"cellwarp": 1, "model": ""})")})
            .err,
        "no.json:1: model: need the name of a file"));
}

TEST(Cli, a_flag_that_needs_a_number_says_so)
{
    const Files files;
    const auto said = [&](const char* flag, const char* value) {
        return run({"deform", files.model, flag, value, "-o", files.out});
    };
    EXPECT_TRUE(
        contains(said("--across", "3.5").err, "--across: got 3.5, need an integer"));
    EXPECT_TRUE(contains(said("--threshold", "little").err,
                         "--threshold: got little, need a number"));
    EXPECT_EQ(said("--across", "3.5").code, 2);
}

TEST(Cli, deform_says_in_one_line_what_it_has_done)
{
    const Files files;
    const Result result = run({"deform", files.model, "--handles", files.handles,
                               "--across", "12", "-o", files.out});
    EXPECT_TRUE(contains(result.err, files.out + ": "));
    EXPECT_TRUE(contains(result.err, " cells, "));
    EXPECT_TRUE(contains(result.err, " s, volume "));
    EXPECT_EQ(result.out, "");
    for (const char* flag : {"--quiet", "--json"})
        EXPECT_FALSE(
            contains(run({"deform", files.model, "--handles", files.handles, "--across",
                          "12", "-o", files.out, "--overwrite", flag})
                         .err,
                     " cells, "));
}

TEST(Cli, regions_that_hold_too_little_or_too_much_are_warnings)
{
    const Files files;
    const auto said = [&](const std::string& statements)
    {
        files.folder.write("w.handles", "cellwarp-handles 1\n" + statements);
        return run({"deform", files.model, "--handles", files.folder / "w.handles",
                    "--across", "12", "-o", files.out, "--overwrite"})
            .err;
    };
    EXPECT_TRUE(contains(said("handle top halfspace 0 0 1 1\nframe 1\nmove top "
                              "translate 0 0 1\n"),
                         "w.handles:2: top: nothing else is held"));
    EXPECT_TRUE(
        contains(said("handle top halfspace 0 0 1 2.01\nfixed foot halfspace 0 0 -1 -2\n"
                      "frame 1\nmove top translate 0 0 1\n"),
                 "the regions hold all cells"));
    EXPECT_TRUE(
        contains(said("fixed foot halfspace 0 0 -1 -0.3\nhandle top halfspace 0 0 "
                      "1 1\nframe 1\nmove top translate 0 0 1\nframe 2\n"),
                 "frame 2: moves nothing"));
}

TEST(Cli, check_and_info_tell_of_parts_and_join_glues_them)
{
    const Files files;
    const Shape two =
        support::joined(support::box_shape({0, 0, 0}, {1, 1, 2}, 4),
                        support::box_shape({0.2, 0.1, 2}, {0.9, 0.8, 3}, 3));
    const std::string model = files.folder.write("two.obj", support::obj_text(two));
    const std::string handles = files.folder.write(
        "two.handles", "cellwarp-handles 1\nfixed foot halfspace 0 0 -1 -0.3\nframe 1\n");
    const auto json = [](const Result& result)
    { return nlohmann::json::parse(result.out); };
    const nlohmann::json told = json(run({"info", model, "--json"}));
    EXPECT_EQ(told["parts"]["count"], 2);
    EXPECT_EQ(told["parts"]["touching"], nlohmann::json::parse("[[0,1]]"));
    EXPECT_TRUE(contains(run({"info", model}).out, "of these touch 0 and 1"));
    const nlohmann::json checked =
        json(run({"check", model, "--handles", handles, "--json"}));
    EXPECT_EQ(checked["parts"], told["parts"]);
    const nlohmann::json joined =
        json(run({"check", model, "--handles", handles, "--json", "--join"}));
    EXPECT_TRUE(joined["parts"].is_null());
    EXPECT_LT(joined["warnings"].size(), checked["warnings"].size());
}

TEST(Cli, info_tells_of_saved_fields)
{
    const Files files;
    const std::string field = files.folder / "bend.cwf";
    ASSERT_EQ(run({"deform", files.model, "--handles", files.handles, "--across", "8",
                   "-o", files.folder / "out.obj", "--save-field", field})
                  .code,
              0);
    const Result told = run({"info", field, "--json"});
    ASSERT_EQ(told.code, 0) << told.err;
    const nlohmann::json json = nlohmann::json::parse(told.out);
    EXPECT_EQ(json["format"], "cwf");
    EXPECT_EQ(json["stages"].size(), 1u);
    EXPECT_EQ(json["stages"][0]["field"], "rbf");
    EXPECT_GT(json["stages"][0]["cells"], 8);
    const nlohmann::json model =
        nlohmann::json::parse(run({"info", files.model, "--json"}).out);
    for (std::size_t side = 0; side < 2; ++side)
        for (std::size_t axis = 0; axis < 3; ++axis)
            EXPECT_NEAR(json["box"][side][axis].get<double>(),
                        model["box"][side][axis].get<double>(), 1e-9);
    EXPECT_TRUE(contains(run({"info", field}).out, "  stage       rbf, "));
    EXPECT_EQ(run({"info", files.folder.write("torn.cwf", "cwfield\n")}).code, 3);
}

TEST(Cli, flat_models_stay_in_their_plane)
{
    const Files files;
    const std::string model =
        files.folder.write("flat.obj", support::obj_text(support::sheet_shape(3, 1, 6)));
    const auto ended = [&](const std::string& move, const std::string& of,
                           std::vector<std::string> flags)
    {
        const std::string handles = files.folder.write(
            "flat.handles", "cellwarp-handles 1\nfixed foot box -1 -1 -1 0.3 2 1\nhandle "
                            "hand box 2.7 -1 -1 4 2 1\nframe 1\nmove hand " +
                                move + "\n");
        std::vector<std::string> all = {"deform", of,        "--handles",  handles,
                                        "-o",     files.out, "--overwrite"};
        flags.insert(flags.end(), {"--across", "12"});
        all.insert(all.end(), flags.begin(), flags.end());
        return run(all);
    };
    EXPECT_EQ(ended("rotate 0 0 1 60", model, {"--flat"}).code, 0);
    const std::string flat = bytes_of(files.out);
    for (const Eigen::Vector3d& x : read_geometry(files.out).geometry.samples)
        EXPECT_EQ(x.z(), 0.0);
    EXPECT_EQ(ended("rotate 0 1 0 60", model, {"--flat"}).code, 3);
    EXPECT_EQ(ended("rotate 0 0 1 60", files.model, {"--flat"}).code, 3);
    // By default where the first frame keeps the plane.
    EXPECT_EQ(ended("rotate 0 0 1 60", model, {}).code, 0);
    EXPECT_EQ(bytes_of(files.out), flat);
    EXPECT_EQ(ended("rotate 0 1 0 60", model, {}).code, 0);
    const std::string turned = bytes_of(files.out);
    EXPECT_EQ(ended("rotate 0 1 0 60", model, {"--no-flat"}).code, 0);
    EXPECT_EQ(bytes_of(files.out), turned);
    EXPECT_EQ(ended("rotate 0 0 1 60", model, {"--no-flat", "--flat"}).code, 2);
    const std::string later = "rotate 0 0 1 20\nframe 2\nmove hand translate 0 0 0.3";
    const Result left = ended(later, model, {});
    EXPECT_EQ(left.code, 3);
    EXPECT_TRUE(contains(left.err, "flat.handles:7: hand: frame 2: leaves the plane"));
    EXPECT_TRUE(contains(left.err, "--no-flat"));
    EXPECT_EQ(ended(later, model, {"--no-flat"}).code, 0);
    const std::string scene = files.folder.write(
        "flat.json",
        R"({"cellwarp": 1, "model": "flat.obj", "handles": "flat.handles"})");
    const Result checked = run({"check", scene});
    EXPECT_EQ(checked.code, 3);
    EXPECT_TRUE(contains(checked.err, "flat.handles:7: hand: frame 2: leaves the plane"));
    EXPECT_EQ(run({"check", scene, "--no-flat"}).code, 0);
}

TEST(Cli, deform_writes_the_last_frame_or_one_a_frame)
{
    const Files files;
    EXPECT_EQ(files.deform().code, 0);
    const std::string last = bytes_of(files.out);
    EXPECT_NE(last, bytes_of(files.model));
    const Result frames =
        run({"deform", files.model, "--handles", files.handles, "--across", "12", "-o",
             files.folder / "f-{frame:04}.obj"});
    EXPECT_EQ(frames.code, 0) << frames.err;
    EXPECT_EQ(bytes_of(files.folder / "f-0012.obj"), last);
    EXPECT_NE(bytes_of(files.folder / "f-0001.obj"), last);
    EXPECT_EQ(run({"deform", files.model, "--handles", files.handles, "--across", "12",
                   "-o", files.folder / "g-{frame}.obj"})
                  .code,
              0);
    EXPECT_EQ(bytes_of(files.folder / "g-12.obj"), last);
}

TEST(Cli, regions_and_moves_may_be_flags)
{
    const Files files;
    const auto deform = [&](std::vector<std::string> more)
    {
        std::vector<std::string> arguments = {"deform", files.model, "--across",   "12",
                                              "-o",     files.out,   "--overwrite"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return run(arguments);
    };
    const std::string handles = files.folder / "same.handles";
    write_file(handles,
               "cellwarp-handles 1\nunits relative\nfixed fixed box 0 0 0 1 1 0.1\n"
               "fixed fixed box 0 0 0.1 1 1 0.15\nhandle head box 0 0 0.9 1 1 1\n"
               "frame 1\nmove head rotate 1 0 0 20 translate 0 0.1 0\n",
               Overwrite::Yes);
    ASSERT_EQ(deform({"--handles", handles}).code, 0);
    const std::string expected = bytes_of(files.out);
    const Result result =
        deform({"--fix", "box 0 0 0 1 1 0.1", "--fix", "box 0 0 0.1 1 1 0.15", "--handle",
                "head box 0 0 0.9 1 1 1", "--move",
                "head rotate 1 0 0 20 translate 0 0.1 0", "--relative"});
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(bytes_of(files.out), expected);

    const auto refused = [&](std::vector<std::string> more)
    {
        const Result wrong = deform(std::move(more));
        EXPECT_EQ(wrong.code, 2) << wrong.err;
        return wrong.err;
    };
    EXPECT_TRUE(contains(refused({"--handles", handles, "--fix", "all"}), "--handles"));
    EXPECT_TRUE(
        contains(refused({"--fix", "box 0 0 0 1 1"}), "--fix: box number 6: is missing"));
    EXPECT_TRUE(contains(refused({"--fix", "all", "--handle", "head"}), "--handle: "));
    EXPECT_TRUE(contains(refused({"--fix", "all", "--move", "tail translate 0 0 1"}),
                         "--move: "));
    EXPECT_TRUE(contains(refused({"--handles", handles, "--relative"}), "--relative"));
    EXPECT_TRUE(contains(refused({"--fix", "all\nframe 1"}), "--fix: "));
    EXPECT_TRUE(contains(refused({"--fix", "all", "--handle", "box 0 0 0 1 1 1"}),
                         "--handle: needs a name before 'box', like 'hand box 0 0 0"));
    EXPECT_TRUE(contains(refused({"--fix", "foot box 0 0 0 1 1 1"}),
                         "--fix: takes no name (got 'foot', need 'box')"));
    // There is no file with lines to look into.
    const std::string twice =
        refused({"--fix", "all", "--handle", "b all", "--move", "b translate 0 0 1",
                 "--move", "b translate 0 1 0"});
    EXPECT_TRUE(contains(twice, "--move: b: is moved twice in this frame\n")) << twice;
    const Result missed = deform(
        {"--fix", "all", "--handle", "b sphere 0 0 99 1", "--move", "b translate 0 0 1"});
    EXPECT_EQ(missed.code, 3);
    EXPECT_TRUE(missed.err.starts_with("error: b: selects nothing")) << missed.err;
    const Result apart =
        deform({"--fix", "all", "--handle", "b all", "--move", "b translate 0 0 1"});
    EXPECT_EQ(apart.code, 6);
    EXPECT_TRUE(contains(apart.err, "fixed region --fix holds all of it")) << apart.err;
    EXPECT_FALSE(contains(apart.err, "line")) << apart.err;
}

TEST(Cli, relative_units_of_a_side_without_a_size_move_nothing_and_say_so)
{
    const support::Folder folder;
    std::string sheet;
    for (int i = 0; i < 9; ++i)
        sheet += fmt::format("v {} 0 {}\n", i % 3, i / 3);
    sheet += "f 1 2 5 4\nf 2 3 6 5\nf 4 5 8 7\nf 5 6 9 8\n";
    const std::string model = folder.write("sheet.obj", sheet);
    const auto warned = [&](const std::string& move)
    {
        const Result result =
            run({"deform", model, "--relative", "--fix", "box 0 0 0 0.2 1 1", "--handle",
                 "e box 0.8 0 0 1 1 1", "--move", "e " + move, "-o", folder / "o.obj",
                 "--overwrite"});
        EXPECT_EQ(result.code, 0) << result.err;
        // A sheet that nothing moves is a shell, which lids would not close; one that
        // moves in its plane is flat.
        const bool moves_nothing = contains(result.err, "e: moves nothing along y");
        EXPECT_EQ(contains(result.err, "nothing is enclosed"), moves_nothing)
            << result.err;
        EXPECT_FALSE(contains(result.err, "--fill closed")) << result.err;
        return moves_nothing;
    };
    EXPECT_TRUE(warned("translate 0 0.3 0"));
    EXPECT_TRUE(warned("matrix 1 0 0 0 0 1 0 0.2 0 0 1 0 0 0 0 1"));
    EXPECT_FALSE(warned("translate 0.3 0 0"));
}

TEST(Cli, self_intersections_are_counted_at_rest_and_afterwards)
{
    const support::Folder folder;
    const auto boxes = [&](double at)
    {
        const Shape two =
            support::joined(support::box_shape({0, 0, 0}, {1, 1, 1}),
                            support::box_shape({at, 0.2, 0.3}, {at + 1, 0.7, 0.8}));
        return folder.write("boxes.obj", support::obj_text(two));
    };
    const auto counted = [&](const std::vector<std::string>& arguments)
    {
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 0) << result.err;
        const nlohmann::json json = nlohmann::json::parse(result.out);
        return std::pair(json["self_intersections"], json["warnings"].dump());
    };
    const bool can_tell = can_tell_triangle_pairs();
    const auto [overlap, no_warning] =
        counted({"check", boxes(0.53), "--fix", "all", "--json"});
    ASSERT_EQ(overlap.is_object(), can_tell);
    EXPECT_FALSE(contains(no_warning, "intersect"));
    if (can_tell)
    {
        EXPECT_GT(overlap["rest"].get<int>(), 10);
    }
    const auto [moved, warning] =
        counted({"deform", boxes(1.5), "--fix", "box 0 0 0 1 1 1", "--handle",
                 "b box 1.5 0 0 3 1 1", "--move", "b translate -0.97 0 0", "--across",
                 "16", "-o", folder / "out.obj", "--json"});
    ASSERT_EQ(moved.is_object(), can_tell);
    EXPECT_EQ(contains(warning, "intersect"), can_tell);
    if (can_tell)
    {
        EXPECT_EQ(moved["rest"].get<int>(), 0);
        EXPECT_EQ(moved["new"].get<int>(), overlap["rest"].get<int>());
        EXPECT_TRUE(contains(warning, "the first at ")) << warning;
    }
}

TEST(Cli, converts_where_that_is_asked_for)
{
    const Files files;
    const auto to = [&](const std::string& name, const std::string& flag)
    {
        std::vector<std::string> arguments = {
            "deform",   files.model, "--handles", files.handles,
            "--across", "12",        "-o",        files.folder / name};
        if (!flag.empty())
            arguments.push_back(flag);
        return run(arguments);
    };
    EXPECT_EQ(files.deform().code, 0);
    const Geometry own = read_geometry(files.out).geometry;
    const Result refused = to("x.ply", "");
    EXPECT_EQ(refused.code, 2);
    EXPECT_TRUE(contains(refused.err, "--convert"));
    for (const char* name : {"x.ply", "x.off", "x.xyz", "x.stl"})
    {
        EXPECT_EQ(to(name, "--convert").code, 0) << name;
        const Geometry other = read_geometry(files.folder / name).geometry;
        EXPECT_EQ(other.num_triangles(),
                  std::string(name) == "x.xyz" ? 0 : own.num_triangles())
            << name;
        if (std::string(name) != "x.stl") // which holds triangles in single precision
        {
            EXPECT_EQ(other.samples, own.samples) << name;
        }
    }
    const Result unknown = to("x.usd", "--convert");
    EXPECT_EQ(unknown.code, 2);
    EXPECT_TRUE(contains(unknown.err, ".stl"));
    // Its own format is patched as ever.
    const Result patched = to("y.obj", "--convert");
    EXPECT_EQ(patched.code, 0);
    EXPECT_FALSE(contains(patched.err, "written anew")) << patched.err;
    EXPECT_EQ(bytes_of(files.folder / "y.obj"), bytes_of(files.out));
}

TEST(Cli, json_has_every_key)
{
    const Files files;
    const Result result = files.deform({"--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const auto json = nlohmann::ordered_json::parse(result.out);
    // In the order of the documentation.
    std::ptrdiff_t last = -1;
    for (const char* key :
         {"model", "samples", "faces", "cells", "free_cells", "depth", "cells_per_depth",
          "frames", "field", "volume", "self_intersections", "ms", "peak_rss_mb",
          "unused", "warnings"})
    {
        ASSERT_TRUE(json.contains(key)) << key;
        const std::ptrdiff_t place = std::distance(json.begin(), json.find(key));
        EXPECT_GT(place, last) << key;
        last = place;
    }
    for (const char* stage :
         {"load", "cells", "solve", "field", "write", "volume", "intersections", "total"})
        EXPECT_TRUE(json["ms"].contains(stage)) << stage;
    ASSERT_EQ(json["frames"].size(), 2u);
    for (const char* key : {"frame", "iterations", "energy_before", "energy_after",
                            "gradient", "stop", "handle_residual", "max_pair_gap", "ms"})
        EXPECT_TRUE(json["frames"][1].contains(key)) << key;
    for (const char* key : {"cells", "solve", "field_fit", "field_apply"})
        EXPECT_TRUE(json["frames"][1]["ms"].contains(key)) << key;
    for (const char* key : {"load", "cells", "solve", "field", "write", "total"})
        EXPECT_TRUE(json["ms"].contains(key)) << key;
    EXPECT_EQ(json["frames"][1]["stop"], "converged");
    EXPECT_TRUE(json["frames"][1]["contacts"].is_null());
    EXPECT_EQ(json["field"]["kind"], "rbf");
    EXPECT_LT(json["field"]["residual"], 1e-9);
    EXPECT_NEAR(json["volume"]["before"].get<double>(), 4.0, 1e-9);
    EXPECT_EQ(json["free_cells"].get<int>() < json["cells"].get<int>(), true);
    const std::vector<std::string> unused = json["unused"];
    EXPECT_TRUE(std::find(unused.begin(), unused.end(), "blend") != unused.end());
    EXPECT_TRUE(std::find(unused.begin(), unused.end(), "interior") == unused.end());
    const nlohmann::json preview =
        nlohmann::json::parse(files.deform({"--json", "--preview", "--overwrite"}).out);
    EXPECT_EQ(preview["field"]["kind"], "blend");
    const std::vector<std::string> not_needed = preview["unused"];
    EXPECT_TRUE(std::find(not_needed.begin(), not_needed.end(), "rbf") !=
                not_needed.end());
    EXPECT_TRUE(std::find(not_needed.begin(), not_needed.end(), "blend") ==
                not_needed.end());
}

TEST(Cli, json_tells_of_contacts_where_they_are_asked_for)
{
    const support::Folder folder;
    const Result result = run({"deform", support::samples_folder() + "/touch.json",
                               "--preview", "-o", folder / "o.ply", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const nlohmann::json json = nlohmann::json::parse(result.out);
    EXPECT_GT(json["frames"][0]["contacts"]["points"], 10);
    EXPECT_GT(json["frames"][0]["contacts"]["deepest"], 0.0);
    const std::vector<std::string> unused = json["unused"];
    EXPECT_TRUE(std::find(unused.begin(), unused.end(), "contact") == unused.end());
}

TEST(Cli, a_wide_opening_that_is_closed_is_told)
{
    const support::Folder folder;
    const std::string model = folder.write(
        "pot.obj", support::obj_text(support::with_hole(
                       support::pot(0.1), Eigen::Vector3d(0, 0.8, 0), 0.45)));
    const std::string handles =
        folder.write("pot.handles", "cellwarp-handles 1\nunits relative\n"
                                    "fixed foot box 0 0 0 1 0.2 1\n"
                                    "handle spout box 0.9 0 0 1 1 1\n"
                                    "frame 1\nmove spout translate 0 0.1 0\n");
    const auto deformed = [&](const std::string& fill)
    {
        return run({"deform", model, "--handles", handles, "--fill", fill, "-o",
                    folder / (fill + ".obj"), "--json", "--preview", "--across", "8",
                    "--max-depth", "0"});
    };
    const Result solid = deformed("solid"), shell = deformed("shell");
    EXPECT_EQ(solid.code, 0) << solid.err;
    EXPECT_EQ(nlohmann::json::parse(solid.out)["material"]["inside"], "hollows");
    EXPECT_NE(solid.err.find("is taken as closed"), std::string::npos) << solid.err;
    EXPECT_EQ(shell.err.find("is taken as closed"), std::string::npos) << shell.err;
}

TEST(Cli, fill_closed_puts_lids_on_a_mesh_that_would_be_a_shell)
{
    const support::Folder folder;
    const std::string scene = support::samples_folder() + "/tower.json";
    const auto played = [&](const std::string& fill, const std::string& name)
    {
        const Result result = run({"deform", scene, "--fill", fill, "-o", folder / name,
                                   "--save-field", folder / (name + ".cwf"), "--json"});
        EXPECT_EQ(result.code, 0) << result.err;
        return nlohmann::json::parse(result.out);
    };
    const nlohmann::json closed = played("closed", "closed.obj");
    const nlohmann::json shell = played("shell", "shell.obj");
    const nlohmann::json solid = played("solid", "solid.obj");
    EXPECT_EQ(closed["material"]["inside"], "winding number");
    EXPECT_EQ(shell["material"]["inside"], "none");
    EXPECT_EQ(closed["warnings"].dump(), "[]");
    EXPECT_TRUE(contains(solid["warnings"].dump(), "--fill closed puts lids"));
    // The tips of its lids are not written, and its walls stay out of each other.
    const Geometry before =
        read_geometry(support::samples_folder() + "/tower.obj", {}).geometry;
    EXPECT_EQ(read_geometry(folder / "closed.obj", {}).geometry.samples.size(),
              before.samples.size());
    if (can_tell_triangle_pairs())
    {
        EXPECT_EQ(closed["self_intersections"]["new"], 0);
        EXPECT_GT(shell["self_intersections"]["new"], 50);
        EXPECT_TRUE(contains(shell["warnings"].dump(), "a thicker shell folds less"));
    }
    // The field that was kept moves the model as the edit did.
    EXPECT_EQ(run({"apply", folder / "closed.obj.cwf",
                   support::samples_folder() + "/tower.obj", "-o", folder / "again.obj"})
                  .code,
              0);
    EXPECT_EQ(bytes_of(folder / "again.obj"), bytes_of(folder / "closed.obj"));
    // A sheet encloses nothing with a lid either.
    const Result sheet =
        run({"deform",
             folder.write("sheet.obj", support::obj_text(support::sheet_shape(3, 1, 12))),
             "--fill", "closed", "--fix", "box -1 -1 -1 0.3 2 1", "--handle",
             "end box 2.7 -1 -1 4 2 1", "--move", "end translate 0 0 0.3", "-o",
             folder / "bent.obj"});
    EXPECT_EQ(sheet.code, 0);
    EXPECT_TRUE(contains(sheet.err, "nothing that lids would enclose"));
}

TEST(Cli, a_notch_that_opens_is_the_same_through_a_field_that_was_kept)
{
    const support::Folder folder;
    const std::string comb = folder.write("comb.obj", support::obj_text(support::comb()));
    // Voxels of a sixth: the slit is narrower than these.
    ASSERT_EQ(run({"deform", comb, "--fix", "box -1 -1 -1 0.5 2 2", "--handle",
                   "tooth box 3.5 0.56 -1 5 2 2", "--move",
                   "tooth rotate 0 0 1 40 about 2 0.5 0.5", "--across", "12",
                   "--max-depth", "0", "--gap", "0.1", "-o", folder / "open.obj",
                   "--save-field", folder / "open.cwf"})
                  .code,
              0);
    ASSERT_EQ(run({"apply", folder / "open.cwf", comb, "-o", folder / "again.obj"}).code,
              0);
    EXPECT_EQ(bytes_of(folder / "again.obj"), bytes_of(folder / "open.obj"));
    // One tooth rises, the other hardly moves.
    const Geometry before = read_geometry(comb, {}).geometry;
    const Geometry after = read_geometry(folder / "open.obj", {}).geometry;
    for (std::size_t i = 0; i < before.samples.size(); ++i)
    {
        const Eigen::Vector3d& x = before.samples[i];
        if (x.x() < 3.0)
            continue;
        const double rise = (after.samples[i] - x).y();
        if (x.y() > 0.5)
        {
            EXPECT_GT(rise, 0.4);
        }
        else
        {
            EXPECT_LT(std::abs(rise), 0.2);
        }
    }
}

TEST(Cli, output_is_the_same_to_the_bit_for_every_number_of_threads)
{
    const Files files;
    std::string first;
    for (const char* threads : {"1", "2", "4", "0", "64"})
    {
        ASSERT_EQ(files.deform({"--threads", threads, "--overwrite"}).code, 0);
        if (first.empty())
            first = bytes_of(files.out);
        EXPECT_EQ(bytes_of(files.out), first);
    }
}

TEST(Cli, without_handles_the_output_is_the_input)
{
    const Files files;
    const Result result = run({"deform", files.model, "-o", files.out, "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(bytes_of(files.out), bytes_of(files.model));
    const nlohmann::json json = nlohmann::json::parse(result.out);
    EXPECT_EQ(json["cells"], 0);
    EXPECT_TRUE(json["frames"].empty());
    EXPECT_EQ(json["warnings"].size(), 1u);
    EXPECT_EQ(run({"check", files.model}).code, 0);
}

TEST(Cli, usage_errors_exit_with_2)
{
    const Files files;
    for (const std::vector<std::string>& arguments :
         std::vector<std::vector<std::string>>{
             {"bend"},
             {"deform"},
             {"deform", files.model},
             {"deform", files.model, "-o", files.folder / "x.ply"},
             {"deform", files.model, "-o", "-", "--json"},
             {"deform", files.model, "-o", files.out, "--across", "0"},
             {"deform", files.model, "-o", files.out, "--across", "x"},
             {"deform", files.model, "-o", files.out, "--gap", "-1"},
             {"deform", files.model, "-o", files.out, "--gap", "nan"},
             {"deform", files.model, "-o", files.out, "--threshold", "-1"},
             {"deform", files.model, "-o", files.out, "--fill", "foam"},
             {"deform", files.model, "-o", files.out, "--solver", "magic"},
             {"deform", files.model, "-o", files.out, "--sel", "a"},
             {"deform", files.model, "-o", files.out, "--max-memory", "lots"},
             {"deform", files.model, "-o", files.folder / "x{frame:x}.obj"},
             {"deform", files.model, "-o", files.folder / "x{frme}.obj"},
             {"deform", files.model, "--handles", files.handles, "-o", files.out,
              "--save-field", files.folder / "field.bin"},
             {"deform", files.model, "-o", files.out, "--save-field",
              files.folder / "no-frame.cwf"},
             {"deform", files.folder / "model.xyzw", "-o", files.out},
             {"info", files.folder / "model.xyzw"},
             {"info", files.model, "--frobnicate"}})
    {
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 2) << ::testing::PrintToString(arguments);
        EXPECT_EQ(result.out.empty(), arguments.back() != "--json");
        EXPECT_TRUE(contains(result.err, "error: "));
    }
    EXPECT_FALSE(std::filesystem::exists(files.out));
    EXPECT_TRUE(
        contains(run({"deform", files.model, "-o", files.folder / "x{frme:04}.obj"}).err,
                 "did you mean {frame} by {frme:04}?"));
    EXPECT_TRUE(contains(files.deform({"--sel", "a", "--def", "b"}).err,
                         "--handles and --sel with --def exclude each other"));
}

TEST(Cli, samples_that_no_region_moves_are_counted)
{
    const support::Folder folder;
    const std::string model = folder.write(
        "m.obj", support::obj_text(support::box_shape({0, 0, 0}, {1, 1, 4}, 2)) +
                     "v 3 3 3\nv 4 4 4\n");
    const std::vector<std::string> all = {"deform",
                                          model,
                                          "-o",
                                          folder / "out{1}.obj",
                                          "--overwrite",
                                          "--fix",
                                          "box -1 -1 -1 2 2 1",
                                          "--handle",
                                          "top box -1 -1 3 2 2 5",
                                          "--move",
                                          "top translate 0 0 0.1"};
    std::vector<std::string> staying = all;
    staying.insert(staying.end(), {"--loose", "stay"});
    const Result result = run(staying);
    EXPECT_EQ(result.code, 0);
    EXPECT_TRUE(contains(result.err,
                         "2 of 3 components have no region: they stay at rest "
                         "(2 of "))
        << result.err;
    EXPECT_TRUE(std::filesystem::exists(folder / "out{1}.obj"));
    staying.back() = "follow";
    for (const std::vector<std::string>& following : {all, staying})
    {
        const Result follows = run(following);
        EXPECT_EQ(follows.code, 0);
        EXPECT_TRUE(contains(follows.err,
                             "2 of 3 parts have no region and go with the part "
                             "nearest to them: 1 with 0, 2 with 1 (2 of "))
            << follows.err;
    }
}

TEST(Cli, malformed_files_exit_with_3_and_leave_nothing)
{
    const Files files;
    files.folder.write("bad.handles", "cellwarp-handles 1\nfixed foot box 0 0 0\n");
    Result result = run({"deform", files.model, "--handles", files.folder / "bad.handles",
                         "-o", files.out, "--json"});
    EXPECT_EQ(result.code, 3);
    EXPECT_TRUE(contains(result.err, "bad.handles:2: box number 4"));
    EXPECT_EQ(nlohmann::json::parse(result.out)["error"]["field"], "box number 4");
    result = run({"info", files.folder.write("bad.obj", "v 0 0\n")});
    EXPECT_EQ(result.code, 3);
    EXPECT_TRUE(contains(result.err, "bad.obj:1: vertex"));
    result = run({"check", files.folder.write("bad.json", "{\"cellwarp\": 1,\n}")});
    EXPECT_EQ(result.code, 3);
    EXPECT_TRUE(contains(result.err, "bad.json:2"));
    EXPECT_FALSE(std::filesystem::exists(files.out));
}

TEST(Cli, file_errors_exit_with_4_before_any_work)
{
    const Files files;
    EXPECT_EQ(run({"info", files.folder / "none.obj"}).code, 4);
    std::filesystem::create_directory(files.folder / "dir.obj");
    EXPECT_TRUE(contains(run({"info", files.folder / "dir.obj"}).err, "is a directory"));
    ASSERT_EQ(files.deform().code, 0);
    const std::string before = bytes_of(files.out);
    const Result exists = files.deform();
    EXPECT_EQ(exists.code, 4);
    EXPECT_TRUE(contains(exists.err, "--overwrite"));
    EXPECT_EQ(bytes_of(files.out), before);
    EXPECT_EQ(files.deform({"--overwrite"}).code, 0);
    EXPECT_EQ(run({"deform", files.model, "--handles", files.handles, "-o",
                   files.folder / "none/x.obj"})
                  .code,
              4);
}

TEST(Cli, the_memory_that_a_scene_is_said_to_need_is_enough_for_it)
{
    if (support::kIsSanitized)
        GTEST_SKIP() << "a sanitizer takes memory of its own";
    const support::Folder folder;
    // Closed, a shell, and one in few of its voxels.
    for (const std::string name : {"bar", "vase", "creature"})
    {
        SCOPED_TRACE(name);
        const auto deform = [&](const std::string& limit)
        {
            return run({"deform", support::samples_folder() + "/" + name + ".json", "-o",
                        folder / "out.obj", "--overwrite", "--json", "--max-memory",
                        limit});
        };
        const Result refused = deform("40M");
        EXPECT_EQ(refused.code, 5);
        const std::string need = " voxels need about ";
        const std::size_t at = refused.err.find(need);
        ASSERT_NE(at, std::string::npos) << refused.err;
        const double megabytes = std::stod(refused.err.substr(at + need.size()));
        const Result kept = deform(fmt::format("{}M", std::ceil(1.02 * megabytes)));
        ASSERT_EQ(kept.code, 0) << kept.err;
        const double peak =
            nlohmann::json::parse(kept.out)["peak_rss_mb"].get<double>() * 1.048576;
        EXPECT_LE(peak, 1.02 * megabytes);
        EXPECT_GE(peak, 0.4 * megabytes); // nor is it said to need much more
    }
}

TEST(Cli, budgets_contradictions_and_limits_have_their_codes)
{
    const Files files;
    EXPECT_EQ(files.deform({"--max-cells", "10"}).code, 5);
    const Result small = files.deform({"--max-memory", "10k"});
    EXPECT_EQ(small.code, 5);
    EXPECT_TRUE(contains(small.err, "bar.obj: a file of")) << small.err;
    files.folder.write(
        "six.handles",
        "cellwarp-handles 1\nfixed foot box -1 -1 -1 1 1 5\nhandle tip indices 0\n"
        "frame 1\n");
    const Result six = run({"deform", files.model, "--handles",
                            files.folder / "six.handles", "-o", files.out});
    EXPECT_EQ(six.code, 6);
    EXPECT_TRUE(contains(six.err,
                         "tip: has no cell of its own: fixed region foot (line 2) "
                         "holds all of it as well"))
        << six.err;
    EXPECT_FALSE(std::filesystem::exists(files.out));
    const Result limited = files.deform({"--max-iterations", "1", "--json"});
    EXPECT_EQ(limited.code, 7);
    EXPECT_TRUE(std::filesystem::exists(files.out));
    EXPECT_TRUE(contains(limited.err, "did not converge"));
    EXPECT_EQ(nlohmann::json::parse(limited.out)["frames"][1]["stop"], "iteration limit");
    EXPECT_EQ(files.deform({"--time", "1e-9", "--overwrite"}).code, 7);
}

TEST(Cli, names_with_odd_characters_are_just_names)
{
    const Files files;
    for (const std::string name :
         {"-x.obj", "a b.obj", "%s%n.obj", "$(x);.obj", "\xc3\xa4.obj"})
    {
        std::filesystem::copy_file(files.model, files.folder / name);
        EXPECT_EQ(run({"info", "--json", files.folder / name}).code, 0) << name;
    }
}

TEST(Cli, info_tells_of_a_scene_and_its_rods)
{
    const support::Folder folder;
    folder.write("model.obj",
                 support::obj_text(support::box_shape({0, 0, 0}, {1, 1, 1}, 2)));
    folder.write("h.handles", "cellwarp-handles 1\nfixed foot box 0 0 0 1 1 0.1\n"
                              "rod spine through 0 0 0  0 0 1 radius 0.1\nframe 1\n"
                              "move spine translate 0 0 1\n");
    const std::string scene = folder.write(
        "s.json", R"({"cellwarp": 1, "model": "model.obj", "handles": "h.handles"})");
    const nlohmann::json json = nlohmann::json::parse(run({"info", "--json", scene}).out);
    EXPECT_EQ(json["samples"], 26);
    EXPECT_EQ(json["frames"], 1);
    EXPECT_EQ(json["regions"][1]["name"], "spine");
    EXPECT_EQ(json["regions"][1]["points"], 2);
    EXPECT_EQ(json["regions"][1]["radius"], 0.1);
    EXPECT_TRUE(contains(run({"info", scene}).out,
                         "  rod         spine, through 2 points, radius 0.1\n"));
    EXPECT_EQ(run({"info", folder.write("bad.json", "{\"model\": 3}")}).code, 3);
}

TEST(Cli, info_describes_one_file_or_several)
{
    const Files files;
    const nlohmann::json one =
        nlohmann::json::parse(run({"info", "--json", files.model}).out);
    EXPECT_EQ(one["format"], "obj");
    EXPECT_EQ(one["samples"], 290);
    EXPECT_EQ(one["faces"], one["triangles"]);
    EXPECT_EQ(one["box"][1][2], 4.0);
    EXPECT_EQ(one["writable"], true);
    const nlohmann::json two =
        nlohmann::json::parse(run({"info", files.model, files.model, "--json"}).out);
    EXPECT_EQ(two["files"].size(), 2u);
    EXPECT_TRUE(contains(run({"info", files.model}).out, "290"));
}

TEST(Cli, a_gltf_that_cannot_be_written_is_told_before_any_work)
{
    const Files files;
    const auto gltf = [](const std::string& nodes, const std::string& uri)
    {
        return R"({"asset":{"version":"2.0"},"nodes":[)" + nodes +
               R"(],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]},)"
               R"({"primitives":[{"attributes":{"POSITION":0},)"
               R"("targets":[{"POSITION":0}]}]}],)"
               R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,)"
               R"("type":"VEC3"}],"bufferViews":[{"buffer":0,"byteLength":36}],)"
               R"("buffers":[{"byteLength":36,"uri":")" +
               uri + R"("}]})";
    };
    const auto deform = [&](const std::string& model, const std::string& out) {
        return run({"deform", model, "--handles", files.handles, "-o", out});
    };
    const std::string shapes =
        files.folder.write("shapes.gltf", gltf(R"({"mesh":1,"name":"left"},{"mesh":0})",
                                               "data:;base64," + std::string(48, 'A')));
    const nlohmann::json info =
        nlohmann::json::parse(run({"info", "--json", shapes}).out);
    EXPECT_EQ(info["samples"], 6);
    EXPECT_EQ(info["writable"], false);
    EXPECT_TRUE(
        contains(run({"info", shapes}).out, "nodes[0] 'left': its mesh has morph"));
    Result result = deform(shapes, files.folder / "out.gltf");
    EXPECT_EQ(result.code, 3);
    EXPECT_TRUE(contains(result.err, "shapes.gltf: cannot be written: nodes[0] 'left'"));
    EXPECT_EQ(deform(shapes, files.folder / "out.glb").code, 2);

    files.folder.write("a.bin", std::string(36, '\0'));
    const std::string beside =
        files.folder.write("beside.gltf", gltf(R"({"mesh":0})", "a.bin"));
    EXPECT_EQ(run({"deform", beside, "-o", "-"}).code, 2);
    files.folder.write("out.bin", "old");
    result = run({"deform", beside, "-o", files.folder / "out.gltf"});
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "out.bin: exists already"));
    EXPECT_FALSE(std::filesystem::exists(files.folder / "out.gltf"));
    EXPECT_EQ(
        run({"deform", beside, "-o", files.folder / "out.gltf", "--overwrite"}).code, 0);
    EXPECT_EQ(bytes_of(files.folder / "out.bin"), std::string(36, '\0'));
    EXPECT_EQ(run({"deform", beside, "-o", files.folder / "f-{frame}.gltf"}).code, 0);
}

TEST(Cli, info_tells_of_the_good_files_among_bad_ones)
{
    const Files files;
    const std::string bad = files.folder.write("bad.obj", "v 0\n");
    const Result result = run({"info", bad, files.model});
    EXPECT_EQ(result.code, 3);
    EXPECT_TRUE(contains(result.err, "bad.obj:1"));
    EXPECT_TRUE(contains(result.out, "290"));
    const Result json = run({"info", files.model, bad, "--json"});
    EXPECT_EQ(json.code, 3);
    EXPECT_EQ(nlohmann::json::parse(json.out)["error"]["file"], bad);
}

TEST(Cli, unknown_commands_and_folders_are_named)
{
    const support::Folder folder;
    EXPECT_TRUE(contains(run({"bend", "x"}).err, "'bend'"));
    EXPECT_EQ(run({"info", folder.path().string()}).code, 4);
}

TEST(Cli, scenes_name_their_parts_and_flags_win)
{
    const Files files;
    const std::string scene = files.folder.write(
        "s.json", R"({"cellwarp": 1, "model": "bar.obj", "handles": "bar.handles",
                      "cells": {"across": 8}})");
    const Result checked = run({"check", scene});
    EXPECT_EQ(checked.code, 0) << checked.err;
    EXPECT_TRUE(contains(checked.out, "2 regions, 2 frames"));
    nlohmann::json json = nlohmann::json::parse(
        run({"deform", scene, "-o", files.out, "--json", "--quiet"}).out);
    EXPECT_EQ(json["across"], 8);
    json = nlohmann::json::parse(
        run({"deform", scene, "-o", files.out, "--json", "--across", "12", "--overwrite"})
            .out);
    EXPECT_EQ(json["across"], 12);
}

TEST(Cli, the_papers_method_is_a_choice_of_the_scene_and_of_a_flag)
{
    const Files files;
    const auto deformed =
        [&](const std::string& energy, const std::vector<std::string>& more)
    {
        const std::string scene = files.folder.write(
            energy + ".json", R"({"cellwarp": 1, "model": "bar.obj",
                "handles": "bar.handles", "energy": ")" +
                                  energy + R"(", "cells": {"across": 8}})");
        std::vector<std::string> words = {"deform",  scene,         "-o",
                                          files.out, "--overwrite", "--json"};
        words.insert(words.end(), more.begin(), more.end());
        const Result result = run(words);
        EXPECT_EQ(result.code, 0) << result.err;
        return nlohmann::json::parse(result.out);
    };
    const nlohmann::json own = deformed("cellwarp", {}), paper = deformed("botsch07", {});
    EXPECT_EQ(own["field"]["kind"], "rbf");
    EXPECT_EQ(paper["field"]["kind"], "rbf-centres");
    EXPECT_EQ(paper["field"]["centres"], paper["cells"]);
    const double energy = own["frames"][0]["energy_after"];
    EXPECT_GT(std::abs(paper["frames"][0]["energy_after"].get<double>() - energy),
              0.01 * energy);
    EXPECT_EQ(deformed("cellwarp", {"--energy", "botsch07"})["frames"][0]["energy_after"],
              paper["frames"][0]["energy_after"]);
    EXPECT_EQ(deformed("botsch07", {"--energy", "cellwarp"})["frames"][0]["energy_after"],
              own["frames"][0]["energy_after"]);
    EXPECT_EQ(run({"deform", files.model, "--handles", files.handles, "-o", files.out,
                   "--energy", "cell"})
                  .code,
              2);
}

TEST(Cli, the_surveys_pair_and_stdout_work)
{
    const Files files;
    std::string sel = "# labels\n";
    const GeometryFile model = read_geometry(files.model);
    for (const Eigen::Vector3d& x : model.geometry.samples)
        sel += x.z() < 0.3 ? "0\n" : x.z() > 3.7 ? "2\n" : "1\n";
    const Result result =
        run({"deform", files.model, "--sel", files.folder.write("a.sel", sel), "--def",
             files.folder.write("a.def", "1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"), "-o",
             "-", "--across", "12"});
    EXPECT_EQ(result.code, 0) << result.err;
    const GeometryFile bent = scan_geometry("x.obj", result.out);
    for (std::size_t i = 0; i < bent.geometry.samples.size(); ++i)
        if (model.geometry.samples[i].z() > 3.7)
        {
            EXPECT_NEAR(bent.geometry.samples[i].x(), model.geometry.samples[i].x() + 0.5,
                        1e-12);
        }
}

TEST(Cli, every_sample_scene_is_in_order)
{
    for (const char* name : {"bar", "plate", "creature", "vase", "cloud", "hand", "coil",
                             "chain", "soup", "scan"})
    {
        const Result result =
            run({"check", support::samples_folder() + "/" + name + ".json"});
        EXPECT_EQ(result.code, 0) << result.err;
    }
}

} // namespace cellwarp::core
