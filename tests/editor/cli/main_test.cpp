// SPDX-License-Identifier: GPL-3.0-or-later
// Help, usage errors and errors as JSON of all commands.
#include <algorithm>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using nlohmann::json;
using support::BarFiles;
using support::contains;
using support::Folder;
using support::Result;
using support::run;

namespace
{

/// Characters of UTF-8 text, not bytes.
std::size_t num_columns(const std::string& line)
{
    return static_cast<std::size_t>(std::count_if(
        line.begin(), line.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

/// The one object that a failure with --json prints.
json error_of_run(const std::vector<std::string>& arguments, int code)
{
    const Result result = run(arguments);
    EXPECT_EQ(result.code, code) << result.err;
    EXPECT_TRUE(json::accept(result.out)) << result.out;
    const json all = json::parse(result.out, nullptr, false);
    EXPECT_TRUE(all.contains("version") && all.contains("error")) << result.out;
    const json error = all.value("error", json::object());
    for (const char* key : {"fault", "file", "line", "field", "message"})
        EXPECT_TRUE(error.contains(key)) << key;
    return error;
}

} // namespace

TEST(Main, without_a_command_prints_the_help_and_ends_as_a_mistake)
{
    const Result result = run({});
    EXPECT_EQ(result.code, 2);
    EXPECT_EQ(result.out, "");
    EXPECT_EQ(result.err, run({"--help"}).out);
    EXPECT_TRUE(contains(result.err, "deform"));
}

TEST(Main, help_is_a_command_too)
{
    EXPECT_EQ(run({"help"}).out, run({"--help"}).out);
    for (const char* command : {"deform", "apply", "info"})
    {
        const Result result = run({"help", command});
        EXPECT_EQ(result.code, 0) << result.err;
        EXPECT_EQ(result.out, run({command, "--help"}).out);
    }
    const Result unknown = run({"help", "defrom"});
    EXPECT_EQ(unknown.code, 2);
    EXPECT_TRUE(contains(unknown.err, "unknown command 'defrom' (did you mean deform?)"));
}

TEST(Main, help_stays_within_80_columns)
{
    std::string all = run({"--help"}).out;
    for (const char* command : {"deform", "apply", "info", "check", "sweep", "edit",
                                "simulate", "skeleton", "render"})
        all += run({command, "--help"}).out;
    std::istringstream lines(all);
    std::size_t num_lines = 0;
    for (std::string line; std::getline(lines, line); ++num_lines)
        EXPECT_LE(num_columns(line), 80u) << line;
    EXPECT_GT(num_lines, 200u);
    // An example that is cut can still be pasted.
    EXPECT_TRUE(contains(all, " \\\n"));
}

TEST(Main, has_short_names_of_common_flags)
{
    EXPECT_EQ(run({"-V"}).out, run({"--version"}).out);
    const BarFiles files;
    const Result result = files.deform({"-q"});
    EXPECT_EQ(result.code, 0);
    EXPECT_EQ(result.err, "");
}

TEST(Main, names_what_it_did_not_expect_in_the_order_given)
{
    const BarFiles files;
    const auto said = [&](const std::vector<std::string>& more)
    {
        std::vector<std::string> arguments = {"deform", files.model, "-o", files.out};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 2);
        return result.err;
    };
    EXPECT_EQ(said({"--acros", "20"}),
              "error: The following arguments were not expected: --acros 20 (did you "
              "mean --across?)\n");
    EXPECT_TRUE(contains(said({"-j", "2"}), "not expected: -j 2"));
    EXPECT_TRUE(contains(said({"--fix", "box", "0", "0", "0", "1", "1", ".1"}),
                         "not expected: 0 0 0 1 1 .1 (quote what --fix takes: --fix "
                         "'box 0 0 0 1 1 .1')"));
    EXPECT_EQ(run({"deform", files.model, "-o"}).err,
              "error: --output: needs a value (TEXT)\n");
}

TEST(Main, takes_sizes_as_people_write_them)
{
    const BarFiles files;
    for (const char* size : {"2000000000", "2G", "2g", "2GB", "2gb", "2000m", "2 GB",
                             "2GiB", "0.002TB", "2000000KB", "2000000000B"})
        EXPECT_EQ(run({"check", files.model, "--max-memory", size}).code, 0) << size;
    for (const char* size : {"2GBB", "2iB", "G", "2 G B", "-2G", "2X", "", "2Gi5"})
    {
        const Result result = run({"check", files.model, "--max-memory", size});
        EXPECT_EQ(result.code, 2) << size;
        EXPECT_TRUE(contains(result.err, "--max-memory: got '" + std::string(size) +
                                             "', need bytes like 500000000, 500M, 2GB or "
                                             "2GiB"))
            << result.err;
    }
    // A kB is 1,000 bytes and a KiB 1,024.
    const auto limit_of = [&](const char* size) {
        return run({"check", files.model, "--fix", "all", "--max-memory", size}).err;
    };
    EXPECT_TRUE(contains(limit_of("100kB"), "limit 0.1 MB")) << limit_of("100kB");
    EXPECT_TRUE(contains(limit_of("9000kB"), "(limit 9 MB)")) << limit_of("9000kB");
    EXPECT_TRUE(contains(limit_of("9000KiB"), "(limit 9.2 MB)")) << limit_of("9000KiB");
}

TEST(Main, says_what_is_wrong_with_names_that_have_no_extension)
{
    const BarFiles files;
    EXPECT_TRUE(
        contains(run({"deform", files.model, "--handles", files.handles, "-o", "x"}).err,
                 "error: x: the output has the model's format (got none, need .obj"));
    EXPECT_TRUE(
        contains(run({"info", ""}).err, "error: '': the extension is no known format"));
}

TEST(Main, tells_errors_as_json)
{
    const BarFiles files;
    json error = error_of_run({"info", "--json", files.folder / "none.obj"}, 4);
    EXPECT_EQ(error["fault"], "file");
    EXPECT_EQ(error["file"], files.folder / "none.obj");
    EXPECT_TRUE(error["line"].is_null() && error["field"].is_null());
    EXPECT_TRUE(contains(error["message"], "No such file"));

    const std::string bad = files.folder.write("bad.obj", "v 0 0 0\nv 1 nought 0\n");
    error = error_of_run({"info", bad, "--json"}, 3);
    EXPECT_EQ(error["fault"], "malformed");
    EXPECT_EQ(error["file"], bad);
    EXPECT_EQ(error["line"], 2);
    EXPECT_TRUE(error["field"].is_string()) << error;

    error = error_of_run(
        {"deform", files.model, "--json", "--fix", "box 0 0 0 1 1", "-o", files.out}, 2);
    EXPECT_EQ(error["fault"], "usage");
    EXPECT_EQ(error["field"], "--fix");
    EXPECT_EQ(error["message"], "box number 6: is missing");
    EXPECT_TRUE(error["file"].is_null());

    // One flag has one name, whoever finds the mistake.
    const std::string old = files.folder.write("old.obj", "old");
    for (const std::vector<std::string>& arguments :
         std::vector<std::vector<std::string>>{
             {"deform", files.model, "--json", "-o"},
             {"deform", files.model, "--json", "-o", "-"},
             {"apply", files.model, files.model, "--json", "-o", "-"},
             {"apply", files.model, files.model, files.model, "--json", "-o", old},
             {"apply", files.model, files.model, "--jobs", "2", "--json", "-o", old},
             {"sweep", files.model, "--handles", files.handles, "--json", "-o", "-"}})
        EXPECT_EQ(error_of_run(arguments, 2)["field"], "--output") << arguments[0];
    EXPECT_EQ(error_of_run({"sweep", files.model, "--stability", "--json", "-o",
                            files.folder / "reports"},
                           2)["field"],
              "--stability");
    // A flag may have a value.
    EXPECT_EQ(
        error_of_run({"info", "--json=true", files.folder / "none.obj"}, 4)["fault"],
        "file");
    EXPECT_EQ(run({"info", "--json=false", files.folder / "none.obj"}).out, "");

    error = error_of_run({"deform", "--json", "--acros"}, 2);
    EXPECT_EQ(error["fault"], "usage");
    EXPECT_TRUE(error["field"].is_null());
    EXPECT_EQ(error_of_run({"bend", "--json"}, 2)["fault"], "usage");
    error = error_of_run(
        {"check", files.model, "--fix", "all", "--max-memory", "1k", "--json"}, 5);
    EXPECT_EQ(error["fault"], "budget");
    const std::string handles = files.folder.write(
        "held.handles", "cellwarp-handles 1\nfixed a all\nhandle b indices 0\nframe 1\n"
                        "move b translate 0 0 1\n");
    error = error_of_run(
        {"check", files.model, "--handles", handles, "--max-depth", "0", "--json"}, 6);
    EXPECT_EQ(error["fault"], "unsolvable");
    EXPECT_EQ(error["file"], handles);
    EXPECT_EQ(error["field"], "b");
    EXPECT_EQ(error["line"], 3);
    // Without --json, or as a name behind --, nothing is on stdout.
    EXPECT_EQ(run({"info", files.folder / "none.obj"}).out, "");
    EXPECT_EQ(run({"info", "--", "--json"}).out, "");
}

TEST(Main, messages_of_flags_name_no_lines)
{
    const BarFiles files;
    const auto said = [&](const std::vector<std::string>& more)
    {
        std::vector<std::string> arguments = {"check", files.model};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return run(arguments).err;
    };
    EXPECT_EQ(said({"--handle", "a all", "--move", "a translate 0 0 1", "--move",
                    "a translate 0 0 2"}),
              "error: --move: a: is moved twice in this frame\n");
    // A name that looks like such a note stays.
    EXPECT_TRUE(contains(said({"--fix", "group \"x (line 3)\""}), "'x (line 3)'"));
}

TEST(Main, every_command_prints_one_object_with_the_version)
{
    const BarFiles files;
    const std::string field = files.folder / "f.cwf", picture = files.folder / "p.png",
                      bones = files.folder / "b.tgf", folder = files.folder / "many";
    const std::string rope =
        files.folder.write("rope.json", R"({"cellwarp": 1, "rods": [{"name": "rope",
            "through": [[0,0,0],[1,0,0]], "fixed": [{"at": 0}]}],
            "simulate": {"dt": 0.01, "duration": 0.02, "every": 0.01}})");
    const std::string version = run({"--version"}).out;
    for (const std::vector<std::string>& arguments :
         std::vector<std::vector<std::string>>{
             files.deform_arguments({"--json", "--save-field", field}),
             {"info", files.model, "--json"},
             {"info", files.model, field, "--json"},
             {"check", files.model, "--handles", files.handles, "--json"},
             {"apply", field, files.model, "-o", files.folder / "a.obj", "--json"},
             {"apply", field, files.model, "-o", folder + "/", "--json"},
             {"render", files.model, "-o", picture, "--size", "40x30", "--json"},
             {"skeleton", files.model, "-o", bones, "--json"},
             {"simulate", rope, "-o", files.folder / "rope.obj", "--json"},
             {"sweep", files.model, "--handles", files.handles, "-o",
              files.folder / "reports", "--max-depth", "1", "--across", "8", "--gap",
              "0.1", "--runs", "1", "--thresholds", "1e-2", "--no-pictures", "--json"}})
    {
        if (!support::can_run(arguments[0]))
            continue;
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 0) << arguments[0] << result.err;
        ASSERT_TRUE(json::accept(result.out)) << arguments[0] << result.out;
        const json all = json::parse(result.out);
        ASSERT_TRUE(all.contains("version")) << arguments[0];
        EXPECT_EQ("cellwarp " + all["version"].get<std::string>() + "\n", version);
        if (arguments[0] == "render")
        {
            EXPECT_EQ(all["output"], picture);
            EXPECT_EQ(all["width"], 40);
            EXPECT_EQ(all["warnings"], json::array());
        }
    }
}

TEST(Main, info_of_one_file_has_the_form_of_many)
{
    const BarFiles files;
    const json one = json::parse(run({"info", files.model, "--json"}).out),
               two = json::parse(run({"info", files.model, files.model, "--json"}).out);
    EXPECT_EQ(one["files"].size(), 1u);
    EXPECT_EQ(two["files"].size(), 2u);
    EXPECT_EQ(one["files"][0], two["files"][1]);
    // And its keys stand where scripts have always found them.
    for (const auto& [key, value] : one["files"][0].items())
        EXPECT_EQ(one[key], value) << key;
    EXPECT_FALSE(two.contains("format"));
}

TEST(Main, a_batch_with_failures_tells_of_each_file_as_json)
{
    const BarFiles files;
    const std::string field = files.folder / "f.cwf", folder = files.folder / "many/";
    ASSERT_EQ(files.deform({"--save-field", field}).code, 0);
    const std::string bad = files.folder.write("bad.obj", "v 0 0 0\nv 1 nought 0\n");
    const Result result = run({"apply", field, files.model, bad, "-o", folder, "--json"});
    EXPECT_EQ(result.code, 3);
    ASSERT_TRUE(json::accept(result.out)) << result.out;
    const json all = json::parse(result.out);
    ASSERT_EQ(all["files"].size(), 2u);
    EXPECT_EQ(all["files"][0]["status"], "done");
    EXPECT_FALSE(all["files"][0].contains("error"));
    EXPECT_EQ(all["files"][1]["status"], "failed");
    EXPECT_EQ(all["files"][1]["error"]["fault"], "malformed");
    EXPECT_EQ(all["files"][1]["error"]["line"], 2);
    EXPECT_TRUE(all.contains("version"));
}

TEST(Main, check_fails_for_what_is_wrong_in_any_part_of_a_scene)
{
    const Folder folder;
    const std::string head = R"({"cellwarp": 1, "model": ")" + support::samples_folder() +
                             R"(/bar.obj", "handles": ")" + support::samples_folder() +
                             "/bar.handles\",\n";
    const auto scene = [&](const std::string& more)
    { return folder.write("s.json", head + more + "}"); };
    // Parts of another command are read like any other.
    for (const auto& [more, says] :
         {std::pair<std::string, std::string>{R"("bodies": "x", "nets": 7)",
                                              "s.json:2: bodies: need a list"},
          {R"("nets": 7)", "s.json:2: nets: need a list"},
          {R"("obstacles": 3)", "s.json:2: obstacles: need a list"},
          {"\"rods\": [\n{\"through\": 3}]", "s.json:3: rods[0].through: need a list"},
          {R"("simulate": {"dt": "soon"})", "s.json:2: simulate.dt: got"},
          {R"("unit": true)", "s.json:2: unit: got"}})
        for (const char* command : {"check", "info"})
        {
            const Result result = run({command, scene(more)});
            EXPECT_EQ(result.code, 3) << more;
            EXPECT_TRUE(contains(result.err, says)) << result.err;
        }
    // All unknown keys are named, with their lines; other commands only warn.
    const std::string unknown = scene("\"colour\": 3, \"cells\": {\n\"acros\": 4},\n"
                                      "\"simulate\": {\"steps\": 4}");
    const Result checked = run({"check", unknown});
    EXPECT_EQ(checked.code, 3);
    for (const char* says : {"s.json:2: colour: unknown key",
                             "s.json:3: cells.acros: unknown key (near across)\n",
                             "s.json:4: simulate.steps: unknown key"})
        EXPECT_TRUE(contains(checked.err, says)) << checked.err;
    EXPECT_EQ(run({"info", unknown}).code, 0);
    const Result deformed = run({"deform", unknown, "-o", folder / "out.obj"});
    EXPECT_EQ(deformed.code, 0) << deformed.err;
    EXPECT_TRUE(contains(deformed.err, "s.json:4: simulate.steps: unknown key"));
    EXPECT_TRUE(contains(deformed.err, "simulate: is for cellwarp simulate, ignored"));
}

TEST(Main, check_looks_at_regions_without_frames_too)
{
    const BarFiles files;
    for (const std::string& frame : {std::string(), std::string("frame 1\n")})
        for (const auto& [region, why] :
             {std::pair("fixed a group nosuch", "the model has no group 'nosuch'"),
              {"handle b labels nofile.sel 2", "nofile.sel: cannot open"},
              {"fixed a indices 100000", "sample index is out of range"},
              {"fixed a box 9 9 9 10 10 10", "selects nothing of the model"}})
        {
            const std::string handles = files.folder.write(
                "h.handles", "cellwarp-handles 1\n" + std::string(region) + "\n" + frame);
            const Result result = run({"check", files.model, "--handles", handles});
            EXPECT_NE(result.code, 0) << region;
            EXPECT_TRUE(contains(result.err, why)) << result.err;
        }
    const std::string handles = files.folder.write(
        "h.handles", "cellwarp-handles 1\nfixed a box -1 -1 -1 1 1 0.3\n");
    const json told =
        json::parse(run({"check", files.model, "--handles", handles, "--json"}).out);
    EXPECT_EQ(told["regions"], 1);
    EXPECT_EQ(told["frames"], 0);
    // After a commit as well.
    const std::string late = files.folder.write(
        "late.handles", "cellwarp-handles 1\nfixed a box -1 -1 -1 1 1 0.3\nframe 1\n"
                        "commit\nhandle b labels nofile.sel 2\n");
    EXPECT_EQ(run({"check", files.model, "--handles", late}).code, 4);
}

} // namespace cellwarp::core
