// SPDX-License-Identifier: GPL-3.0-or-later
// The subcommand sweep: its reports, flags and exit codes. The numbers have their own
// tests.
#include <csignal>
#include <filesystem>
#include <map>
#include <sstream>

#include <unistd.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "editor/cli/pictures.h"
#include "editor/cli/sweep_report.h"
#include "io/base/number.h"
#include "io/formats/geometry_file.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::num_files;
using support::Result;
using support::run;

namespace
{

/// The small bar, swept with few cells and few voxels.
struct Files : support::BarFiles
{
    std::string reports = folder / "reports";

    std::vector<std::string> arguments(const std::vector<std::string>& more = {}) const
    {
        std::vector<std::string> all = {"sweep",    model,   "--handles",    handles,
                                        "-o",       reports, "--max-depth",  "1",
                                        "--across", "8",     "--gap",        "0.1",
                                        "--runs",   "1",     "--thresholds", "1e-2,1e-4"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    Result sweep(const std::vector<std::string>& more = {"--no-pictures"}) const
    {
        return run(arguments(more));
    }
    std::string report(const std::string& name) const
    {
        return bytes_of(reports + "/" + name);
    }
};

/// The fields of a CSV text by column, a map a line. No field may hold a line's end.
std::vector<std::map<std::string, std::string>> parsed_csv(const std::string& text)
{
    std::vector<std::vector<std::string>> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);)
    {
        std::vector<std::string>& fields = lines.emplace_back(1);
        bool is_quoted = false;
        for (std::size_t i = 0; i < line.size(); ++i)
            if (line[i] == '"' && is_quoted && i + 1 < line.size() && line[i + 1] == '"')
                fields.back() += line[i++];
            else if (line[i] == '"')
                is_quoted = !is_quoted;
            else if (line[i] == ',' && !is_quoted)
                fields.emplace_back();
            else
                fields.back() += line[i];
        EXPECT_FALSE(is_quoted);
    }
    std::vector<std::map<std::string, std::string>> rows;
    for (std::size_t l = 1; l < lines.size(); ++l)
    {
        EXPECT_EQ(lines[l].size(), lines[0].size());
        for (std::size_t f = 0; f < std::min(lines[l].size(), lines[0].size()); ++f)
            rows.resize(l), rows.back()[lines[0][f]] = lines[l][f];
    }
    return rows;
}

/// Data that a page draws.
nlohmann::json data_of(const std::string& page)
{
    const std::string before = "<script id=\"data\" type=\"application/json\">";
    const std::size_t start = page.find(before) + before.size();
    return nlohmann::json::parse(
        page.substr(start, page.find("</script>", start) - start));
}

/// Without what is measured in seconds or megabytes, and the number of threads.
nlohmann::json without_times(nlohmann::json json)
{
    if (json.is_array())
        for (nlohmann::json& element : json)
            element = without_times(element);
    if (!json.is_object())
        return json;
    for (auto item = json.begin(); item != json.end();)
    {
        item.value() = without_times(item.value());
        const bool is_time = contains(item.key(), "seconds") || item.key() == "peak_mb" ||
                             item.key() == "threads";
        item = is_time ? json.erase(item) : std::next(item);
    }
    return json;
}

/// The samples of a file as text in columns: another format than the bar's.
std::string as_columns(const std::string& path)
{
    std::string text;
    for (const Eigen::Vector3d& x : read_geometry(path).geometry.samples)
        text += shortest(x.x()) + " " + shortest(x.y()) + " " + shortest(x.z()) + "\n";
    return text;
}

} // namespace

TEST(SweepCommand, csv_has_its_columns_and_a_line_for_every_run)
{
    const Files files;
    const Result result = files.sweep();
    ASSERT_EQ(result.code, 0) << result.err;
    const std::string csv = files.report("report.csv");
    EXPECT_TRUE(csv.starts_with(
        "kind,threshold,max_depth,interpolator,max_iterations,max_error,rms_error,"
        "finest_interpolator,field_max,field_rms,cells_max,cells_rms,cells,cell_edge,"
        "iterations,seconds,load_seconds,cells_seconds,solve_seconds,field_fit_seconds,"
        "field_apply_seconds,peak_mb,energy,gradient,stop,scene\n"));
    const auto rows = parsed_csv(csv);
    ASSERT_EQ(rows.size(), 1u + 2 * (2 + 2));
    for (auto row : rows)
    {
        SCOPED_TRACE(row["kind"] + " " + row["interpolator"]);
        EXPECT_EQ(row["threshold"].empty(), row["kind"] != "adaptive");
        for (const char* column : {"max_depth", "cells", "iterations"})
            EXPECT_TRUE(parse_integer(row[column])) << column;
        for (const char* column : {"max_error", "rms_error", "cells_max", "cells_rms",
                                   "seconds", "peak_mb", "energy"})
            EXPECT_TRUE(parse_double(row[column])) << column;
        EXPECT_EQ(row["finest_interpolator"], "rbf");
        for (const char* column : {"field_max", "field_rms"})
            EXPECT_EQ(row[column].empty(), row["interpolator"] == "rbf") << column;
        EXPECT_EQ(row["stop"], "converged");
        EXPECT_EQ(row["scene"], files.model);
    }
    auto reference = rows[0], coarse = rows[1];
    EXPECT_EQ(reference["kind"], "reference");
    EXPECT_EQ(reference["max_error"], "0");
    EXPECT_EQ(coarse["kind"], "uniform");
    EXPECT_EQ(coarse["max_depth"], "0");
    // All digits are there: the shortest text that reads back the same.
    const double error = parse_double(coarse["max_error"]).value();
    EXPECT_EQ(shortest(error), coarse["max_error"]);
    EXPECT_GE(coarse["max_error"].size(), 15u);
    const nlohmann::json json = nlohmann::json::parse(files.report("report.json"));
    EXPECT_EQ(json["rows"][1]["max_error"], error);
}

TEST(SweepCommand, json_has_every_key_and_goes_to_stdout_too)
{
    const Files files;
    const Result result = files.sweep({"--no-pictures", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(result.out, files.report("report.json"));
    const nlohmann::json json = nlohmann::json::parse(result.out);
    for (const char* key : {"scene", "model", "samples", "faces", "settings", "machine",
                            "peak_is_of", "rows", "convergence", "savings", "warnings"})
        EXPECT_TRUE(json.contains(key)) << key;
    for (const char* key :
         {"processor", "cores", "threads", "compiler", "build", "version"})
        EXPECT_TRUE(json["machine"].contains(key)) << key;
    for (const char* key :
         {"kind", "threshold", "max_depth", "grid_depth", "interpolator", "max_error",
          "rms_error", "error_parts", "cells", "cells_per_depth", "iterations", "energy",
          "gradient", "stop", "frames", "seconds", "stage_seconds", "run_seconds",
          "peak_mb"})
        EXPECT_TRUE(json["rows"][2].contains(key)) << key;
    EXPECT_EQ(json["rows"][0]["frames"].size(), 2u);
    EXPECT_EQ(json["rows"][1]["error_parts"]["cells"]["rms"],
              json["rows"][1]["rms_error"]);
    EXPECT_TRUE(json["rows"][1]["error_parts"]["field"].is_null());
    EXPECT_TRUE(json["rows"][0]["threshold"].is_null());
    EXPECT_EQ(json["rows"][3]["threshold"], 1e-2);
}

TEST(SweepCommand, every_run_is_compared_with_a_file_from_elsewhere)
{
    const Files files;
    ASSERT_EQ(run({"deform", files.model, "--handles", files.handles, "-o", files.out,
                   "--across", "8", "--gap", "0.1", "--max-depth", "0"})
                  .code,
              0);
    const std::string other = files.folder.write("other.xyz", as_columns(files.out));
    const Result result = files.sweep({"--no-pictures", "--json", "--against", other});
    ASSERT_EQ(result.code, 0) << result.err;
    const std::string csv = files.report("report.csv");
    EXPECT_TRUE(contains(csv, ",gradient,stop,scene,against_max,against_rms\n"));
    const auto rows = parsed_csv(csv);
    const nlohmann::json json = nlohmann::json::parse(result.out);
    EXPECT_EQ(json["against"], other);
    ASSERT_EQ(json["rows"].size(), rows.size());
    for (std::size_t r = 0; r < rows.size(); ++r)
    {
        SCOPED_TRACE(rows[r].at("kind") + " " + rows[r].at("interpolator"));
        const double largest = parse_double(rows[r].at("against_max")).value();
        const double rms = parse_double(rows[r].at("against_rms")).value();
        EXPECT_EQ(json["rows"][r]["against_max"], largest);
        EXPECT_EQ(json["rows"][r]["against_rms"], rms);
        EXPECT_LE(rms, largest);
        EXPECT_LT(largest, 0.1);
    }
    EXPECT_EQ(rows[1].at("against_max"), "0") << "the cells that the file is from";
    EXPECT_GT(parse_double(rows[0].at("against_rms")).value(), 1e-4);
    EXPECT_EQ(data_of(files.report("report.html"))["report"]["against"], other);
}

TEST(SweepCommand, departures_are_taken_back_in_a_column_of_their_own)
{
    const Files files;
    const std::string folder = files.folder / "departures";
    const Result result = run({"sweep", files.model, "--handles", files.handles, "-o",
                               folder, "--across", "8", "--gap", "0.1", "--max-depth",
                               "1", "--runs", "1", "--no-pictures", "--departures"});
    ASSERT_EQ(result.code, 0) << result.err;
    const std::string csv = support::bytes_of(folder + "/report.csv");
    EXPECT_TRUE(contains(csv, ",stop,scene,without\n"));
    const auto rows = parsed_csv(csv);
    EXPECT_EQ(rows.size(), 25u);
    EXPECT_EQ(rows[1].at("without"), "");
    EXPECT_EQ(rows.back().at("without"), "all (botsch07)");
    EXPECT_EQ(rows.back().at("interpolator"), "closest4");
    EXPECT_TRUE(contains(result.out, "uniform 0, rbf, without measured borders: error "));
    EXPECT_EQ(run({"sweep", files.model, "--handles", files.handles, "-o", folder,
                   "--overwrite", "--departures", "--thresholds", "1e-3"})
                  .code,
              2);
    const Result twice =
        run({"sweep", files.model, "--handles", files.handles, "-o", folder,
             "--overwrite", "--departures", "--energy", "botsch07"});
    EXPECT_EQ(twice.code, 2);
    EXPECT_TRUE(contains(twice.err, "--departures compares with botsch07 by itself"));
}

TEST(SweepCommand, without_a_file_from_elsewhere_no_report_tells_of_one)
{
    const Files files;
    const Result result = files.sweep({"--no-pictures", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    for (const std::string& text : {result.out, files.report("report.csv"),
                                    data_of(files.report("report.html")).dump()})
        EXPECT_FALSE(contains(text, "against") || contains(text, "elsewhere"));
}

TEST(SweepCommand, a_file_from_elsewhere_that_does_not_fit_fails_before_any_work)
{
    const Files files;
    const std::string few = files.folder.write("few.xyz", "0 0 0\n1 0 0\n");
    const std::string bad = files.folder.write("bad.xyz", "0 0 zero\n");
    // So few cells that the work itself would fail with 5.
    const auto against = [&](const std::string& path) {
        return files.sweep({"--no-pictures", "--max-cells", "10", "--against", path});
    };
    const Result of_few = against(few);
    EXPECT_EQ(of_few.code, 3);
    EXPECT_TRUE(contains(of_few.err, "error: " + few + ": has 2 samples, need "))
        << of_few.err;
    EXPECT_EQ(against(bad).code, 3);
    EXPECT_EQ(against(files.folder / "none.obj").code, 4);
    EXPECT_EQ(against(files.model).code, 5);
    EXPECT_FALSE(std::filesystem::exists(files.reports));
}

TEST(SweepCommand, reports_are_the_same_but_for_times_and_memory)
{
    const Files files;
    std::string first_json, first_csv;
    for (const char* threads : {"0", "1", "2"})
    {
        const Result result =
            files.sweep({"--no-pictures", "--json", "--overwrite", "--threads", threads});
        ASSERT_EQ(result.code, 0) << result.err;
        const std::string json = without_times(nlohmann::json::parse(result.out)).dump();
        std::string csv;
        for (auto row : parsed_csv(files.report("report.csv")))
            for (const auto& [column, field] : row)
                if (!contains(column, "seconds") && column != "peak_mb")
                    csv += field + "\n";
        if (first_json.empty())
            first_json = json, first_csv = csv;
        EXPECT_EQ(json, first_json);
        EXPECT_EQ(csv, first_csv);
    }
}

TEST(SweepCommand, the_page_stands_alone_and_has_all_that_is_reported)
{
    const Files files;
    const Result result = files.sweep({"--iterations", "1,3"});
    ASSERT_EQ(result.code, 0);
    std::string page = files.report("report.html");
    const nlohmann::json data = data_of(page);
    EXPECT_EQ(data["kind"], "sweep");
    nlohmann::json report = nlohmann::json::parse(files.report("report.json"));
    report.erase("version");
    EXPECT_EQ(data["report"], report);
    std::string findings;
    for (const nlohmann::json& finding : data["findings"])
        findings += finding.get<std::string>() + "\n";
    EXPECT_EQ(result.out, findings + files.reports + "/report.html\n");
    const std::string png = data["picture"]["png"];
    if (!png.empty())
        page.erase(page.find(png), png.size());
    for (const char* outside :
         {"http:", "https:", "//", "<link", "@import", "url(", " src=", " href="})
        EXPECT_FALSE(contains(page, outside)) << outside;
}

TEST(SweepCommand, stability_runs_extremes_and_leaves_their_scenes)
{
    const support::Folder folder;
    const std::string reports = folder / "stability";
    const std::string scene = support::samples_folder() + "/block.json";
    const Result result =
        run({"sweep", scene, "--stability", "-o", reports, "--only", "scale", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const nlohmann::json json = nlohmann::json::parse(result.out);
    EXPECT_EQ(json, nlohmann::json::parse(bytes_of(reports + "/stability.json")));
    EXPECT_EQ(json["faulty"], 0);
    EXPECT_EQ(json["cases"].size(), 7u); // the scene, five of scales, and their base
    for (const nlohmann::json& row : json["cases"])
    {
        EXPECT_EQ(row["outcome"], "converged");
        EXPECT_EQ(row["same_bits"], true);
        EXPECT_LE(row["energy_rise"], 1e-12);
        EXPECT_LE(row["handle_residual"], 1e-9);
        EXPECT_LE(row["orthonormality"], 1e-12);
        // Each of them is a scene that any command takes.
        EXPECT_EQ(run({"check", row["scene"].get<std::string>()}).code, 0);
    }
    const nlohmann::json data = data_of(bytes_of(reports + "/stability.html"));
    EXPECT_EQ(data["kind"], "stability");
    EXPECT_EQ(data["report"]["cases"], json["cases"]);
    const auto rows = parsed_csv(bytes_of(reports + "/stability.csv"));
    ASSERT_EQ(rows.size(), 7u);
    for (std::size_t r = 0; r < rows.size(); ++r)
    {
        EXPECT_EQ(rows[r].at("name"), json["cases"][r]["name"]);
        EXPECT_EQ(rows[r].at("faults"), "");
        EXPECT_EQ(parse_double(rows[r].at("orthonormality")).value(),
                  json["cases"][r]["orthonormality"]);
    }
    EXPECT_EQ(run({"sweep", scene, "--stability", "-o", reports, "--only", "scale"}).code,
              4); // it is there
    EXPECT_FALSE(std::filesystem::exists(reports + "/scenes/twist-180.json"));
    EXPECT_EQ(run({"sweep", "--stability", "-o", folder / "x", "--only", "nothing"}).code,
              2);
    EXPECT_EQ(run({"sweep", scene, "-o", folder / "x", "--only", "scale"}).code, 2);
    EXPECT_EQ(run({"sweep", "bar.obj", "--stability", "-o", folder / "x"}).code, 2);
    EXPECT_EQ(run({"sweep", "-o", folder / "x"}).code, 2);
}

TEST(SweepCommand, clusters_of_other_sizes_are_interpolators)
{
    const Files files;
    const Result result =
        files.sweep({"--no-pictures", "--interpolators", "rbf:1:1.5:1.5,rbf-global"});
    ASSERT_EQ(result.code, 0) << result.err;
    auto rows = parsed_csv(files.report("report.csv"));
    EXPECT_EQ(rows.at(1)["interpolator"], "rbf:1:1.5:1.5");
    EXPECT_EQ(rows.at(1)["finest_interpolator"], "rbf-global");
    EXPECT_GT(parse_double(rows.at(1)["field_max"]).value(), 0.0);
    EXPECT_TRUE(contains(result.out, "Uniform depth 0: the cells' own error (rbf-global) "
                                     "is at most "))
        << result.out;
    EXPECT_TRUE(contains(result.out, "; rbf:1:1.5:1.5 is off that by at most "));
}

TEST(SweepCommand, the_page_has_pictures_where_the_build_has)
{
    const Files files;
    ASSERT_EQ(files.sweep({}).code, 0);
    const nlohmann::json picture = data_of(files.report("report.html"))["picture"];
    const bool has_picture = picture["png"].get<std::string>().starts_with("iVBORw0KGgo");
    EXPECT_NE(has_picture,
              contains(picture["caption"], "No pictures: this build has none"));
    EXPECT_EQ(has_picture, make_pictures().has_value());
    ASSERT_EQ(files.sweep({"--no-pictures", "--overwrite"}).code, 0);
    EXPECT_EQ(data_of(files.report("report.html"))["picture"]["caption"],
              "No pictures were asked for.");
}

TEST(SweepCommand, a_scene_with_an_odd_name_is_escaped_everywhere)
{
    const Files files;
    const std::string name = "a<b>&\"c,d.json";
    files.folder.write(
        name, R"({"cellwarp": 1, "model": "bar.obj", "handles": "bar.handles"})");
    std::vector<std::string> arguments = files.arguments({"--no-pictures"});
    arguments[1] = files.folder / name;
    arguments.erase(arguments.begin() + 2, arguments.begin() + 4);
    const Result result = run(arguments);
    ASSERT_EQ(result.code, 0) << result.err;
    auto rows = parsed_csv(files.report("report.csv"));
    EXPECT_EQ(rows.at(0)["scene"], files.folder / name);
    EXPECT_EQ(nlohmann::json::parse(files.report("report.json"))["scene"],
              files.folder / name);
    const std::string page = files.report("report.html");
    EXPECT_EQ(data_of(page)["report"]["scene"], files.folder / name);
    EXPECT_FALSE(contains(page, "a<b>"));
}

TEST(SweepCommand, reports_are_replaced_only_when_asked_to_and_before_any_work)
{
    const Files files;
    ASSERT_EQ(files.sweep().code, 0);
    EXPECT_EQ(num_files(files.folder), 3u);
    std::filesystem::remove(files.reports + "/report.json");
    std::filesystem::remove(files.reports + "/report.csv");
    const std::string page = files.report("report.html");
    const Result again = files.sweep();
    EXPECT_EQ(again.code, 4);
    EXPECT_TRUE(contains(again.err, "report.html: exists already (use --overwrite"));
    EXPECT_FALSE(std::filesystem::exists(files.reports + "/report.json"));
    EXPECT_EQ(files.report("report.html"), page);
    EXPECT_EQ(files.sweep({"--no-pictures", "--overwrite"}).code, 0);
    EXPECT_TRUE(std::filesystem::exists(files.reports + "/report.json"));
}

TEST(SweepCommand, folders_that_cannot_be_are_file_errors)
{
    const Files files;
    std::vector<std::string> arguments = files.arguments();
    for (const std::string& folder :
         {files.model, files.folder / "none/reports", std::string("")})
    {
        arguments[5] = folder;
        EXPECT_EQ(run(arguments).code, 4) << folder;
    }
    arguments[5] = files.folder / "link";
    std::filesystem::create_symlink(files.folder / "nothing", arguments[5]);
    const Result link = run(arguments);
    EXPECT_EQ(link.code, 4);
    EXPECT_TRUE(contains(link.err, "link: cannot make it: ")) << link.err;
    arguments[5] = "-";
    EXPECT_EQ(run(arguments).code, 2);
    arguments = files.arguments({"--no-pictures"});
    arguments[5] = files.reports + "//";
    EXPECT_EQ(run(arguments).code, 0);
    EXPECT_TRUE(std::filesystem::exists(files.reports + "/report.csv"));
}

TEST(SweepCommand, wrong_flags_exit_with_2)
{
    const Files files;
    for (const std::vector<std::string>& flags :
         std::vector<std::vector<std::string>>{{"--thresholds", "0"},
                                               {"--thresholds", "1e-2,"},
                                               {"--thresholds", "nan"},
                                               {"--thresholds", "inf"},
                                               {"--thresholds", "1e-2 1e-3"},
                                               {"--depths", "2"},
                                               {"--depths", "-1"},
                                               {"--depths", "1.5"},
                                               {"--iterations", "x"},
                                               {"--iterations", "-1"},
                                               {"--interpolators", "spline"},
                                               {"--interpolators", "rbf,"},
                                               {"--interpolators", "rbf:2:2"},
                                               {"--interpolators", "rbf:2:3:2"},
                                               {"--runs", "0"},
                                               {"--runs", "many"},
                                               {"--max-depth", "-1"},
                                               {"--threshold", "1e-3"},
                                               {"--preview"}})
    {
        std::vector<std::string> arguments = files.arguments(flags);
        // A flag that is there already may not come twice.
        for (std::size_t i = 2; i + flags.size() < arguments.size(); ++i)
            if (arguments[i] == flags[0])
            {
                arguments.erase(arguments.begin() + static_cast<std::ptrdiff_t>(i),
                                arguments.begin() + static_cast<std::ptrdiff_t>(i) + 2);
                break;
            }
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 2) << ::testing::PrintToString(flags) << result.err;
        EXPECT_TRUE(contains(result.err, "error: "));
    }
    EXPECT_FALSE(std::filesystem::exists(files.reports));
    EXPECT_EQ(run({"sweep", files.model}).code, 2);
}

TEST(SweepCommand, a_scene_without_frames_is_a_usage_error)
{
    const Files files;
    for (const std::string& handles :
         {std::string(),
          files.folder.write("still.handles", "cellwarp-handles 1\nfixed a all\n")})
    {
        std::vector<std::string> arguments = {"sweep", files.model, "-o", files.reports};
        if (!handles.empty())
            arguments.insert(arguments.end(), {"--handles", handles});
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 2);
        EXPECT_TRUE(contains(result.err, "has no frame")) << result.err;
        EXPECT_FALSE(std::filesystem::exists(files.reports));
    }
}

TEST(SweepCommand, malformed_inputs_and_budgets_have_their_codes_and_leave_nothing)
{
    const Files files;
    std::vector<std::string> arguments = files.arguments();
    arguments[3] = files.folder.write("bad.handles", "cellwarp-handles 1\nfixed foot\n");
    EXPECT_EQ(run(arguments).code, 3);
    arguments[3] = files.folder / "none.handles";
    EXPECT_EQ(run(arguments).code, 4);
    const Result budget = files.sweep({"--max-cells", "100", "--json"});
    EXPECT_EQ(budget.code, 5);
    EXPECT_TRUE(contains(budget.err, "use --max-depth 0")) << budget.err;
    EXPECT_EQ(nlohmann::json::parse(budget.out)["error"]["fault"], "budget");
    const Result voxels = files.sweep({"--max-memory", "40M"});
    EXPECT_EQ(voxels.code, 5);
    EXPECT_TRUE(contains(voxels.err, "voxels need about")) << voxels.err;
    EXPECT_FALSE(std::filesystem::exists(files.reports));
}

TEST(SweepCommand, runs_that_do_not_converge_exit_with_7_and_are_reported)
{
    const Files files;
    const Result result = files.sweep({"--no-pictures", "--max-iterations", "1"});
    EXPECT_EQ(result.code, 7);
    EXPECT_TRUE(contains(result.err, "uniform 1, rbf: frame 12 did not converge"))
        << result.err;
    auto rows = parsed_csv(files.report("report.csv"));
    EXPECT_EQ(rows.at(0)["stop"], "converged");
    EXPECT_EQ(rows.at(1)["stop"], "iteration limit");
    EXPECT_EQ(
        files.sweep({"--no-pictures", "--overwrite", "--quiet", "--max-iterations", "1"})
            .err,
        "");
    EXPECT_EQ(files.sweep({"--no-pictures", "--overwrite", "--iterations", "1"}).code, 0);
}

TEST(SweepCommand, a_run_that_is_not_possible_has_empty_fields)
{
    const Files files;
    std::vector<std::string> arguments = files.arguments(
        {"--no-pictures", "--interpolators", "rbf-global", "--max-memory", "80M"});
    arguments[7] = "2";
    const Result result = run(arguments);
    EXPECT_EQ(result.code, 7) << result.err;
    auto rows = parsed_csv(files.report("report.csv"));
    EXPECT_EQ(rows.at(3)["stop"], "failed");
    EXPECT_EQ(rows.at(3)["max_error"], "");
    EXPECT_EQ(rows.at(3)["cells"], "");
    EXPECT_TRUE(
        contains(data_of(files.report("report.html"))["report"]["rows"][3]["failure"],
                 "the global release field of"));
}

TEST(SweepCommand, an_interrupt_leaves_nothing)
{
    const Files files;
    std::vector<std::string> arguments = files.arguments();
    arguments[9] = "48";
    const pid_t child = support::start(arguments);
    support::wait_until_caught(child, SIGINT);
    ::usleep(100000);
    ::kill(child, SIGINT);
    EXPECT_EQ(support::wait_for(child), 130);
    EXPECT_EQ(num_files(files.folder), 2u);
}

TEST(SweepCommand, help_starts_with_examples_and_tells_every_default)
{
    const Result result = run({"sweep", "--help"});
    EXPECT_EQ(result.code, 0);
    EXPECT_LT(result.out.find("  cellwarp sweep "), result.out.find("Usage"));
    for (const char* flag : {"--thresholds", "--depths", "--interpolators",
                             "--iterations", "--runs", "--max-depth", "--max-cells"})
    {
        const std::size_t at = result.out.find(std::string("\n  ") + flag);
        ASSERT_NE(at, std::string::npos) << flag;
        const std::size_t next = result.out.find("\n  -", at + 1); // of another flag
        EXPECT_TRUE(contains(result.out.substr(at, next - at), "default")) << flag;
    }
}

TEST(SweepReport, sentences_tell_orders_and_savings_and_what_does_not_pay)
{
    SweepReport report;
    const auto add =
        [&](SweepKind kind, int depth, double error, std::size_t cells, double seconds)
    {
        SweepRow& row = report.result.rows.emplace_back();
        row.of.kind = kind;
        row.of.depth = depth;
        row.of.reference_depth = 3;
        row.error = {error, 0.25 * error};
        row.cells = cells;
        row.cell_edge = std::pow(0.5, depth);
        row.seconds.total = seconds;
    };
    add(SweepKind::Uniform, 0, 8e-3, 100, 0.1);
    add(SweepKind::Uniform, 1, 4e-3, 800, 0.8);
    add(SweepKind::Uniform, 2, 2e-3, 6400, 6.4);
    add(SweepKind::Adaptive, 3, 8e-3, 100, 0.1);
    add(SweepKind::Adaptive, 3, 4e-3, 200, 0.9);
    const std::vector<std::string> sentences = sweep_sentences(report);
    ASSERT_EQ(sentences.size(), 3u);
    EXPECT_EQ(
        sentences[0],
        "Uniform cells, rbf: the largest error falls with the power 1.00 of the cell "
        "edge, the RMS error with 1.00 (least squares, against the reference).");
    EXPECT_EQ(
        sentences[1],
        "Adaptive cells to depth 3, rbf: the largest error of uniform depth 1 (0.004) "
        "with 0.25 of its cells and 1.12 times its time, which does not pay; its RMS "
        "error (0.001) with 0.25 of its cells and 1.12 times its time, which does not "
        "pay.");
    EXPECT_TRUE(contains(sentences[2], "of uniform depth 2 (0.002) is not reached"));
}

} // namespace cellwarp::core
