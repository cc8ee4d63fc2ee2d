// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp sweep: error against run time, over thresholds, depths and fields.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "editor/cli/command.h"
#include "editor/cli/machine.h"
#include "editor/cli/pictures.h"
#include "editor/cli/progress.h"
#include "editor/cli/report.h"
#include "editor/cli/session_flags.h"
#include "editor/cli/stability.h"
#include "editor/cli/sweep_report.h"
#include "io/base/base64.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "library/session/json.h"
#include "octree/base/helper.h"

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

struct SweepFlags
{
    SessionFlags session;
    std::string output, thresholds, depths, iterations, interpolators;
    std::optional<std::string> against;
    std::int64_t runs = SweepSettings().runs;
    bool has_no_pictures = false, takes_back = false;
    bool is_stability = false;
    std::int64_t long_steps = 1000000;
    std::string only;
};

/// Most runs of a case, and most iterations that can be asked for.
constexpr std::int64_t kMaxRuns = 1000, kMaxIterations = 1000000;

/// The parts of "a,b,c".
std::vector<std::string> parts_of(const std::string& list)
{
    std::vector<std::string> parts;
    for (std::size_t start = 0; start <= list.size();)
    {
        const std::size_t comma = std::min(list.find(',', start), list.size());
        parts.push_back(list.substr(start, comma - start));
        start = comma + 1;
    }
    return parts;
}

/// A list of whole numbers, in rising order.
std::vector<int> integers_of(const char* flag, const std::string& list, std::int64_t low,
                             std::int64_t high)
{
    std::vector<int> numbers;
    for (const std::string& part : parts_of(list))
    {
        const std::optional<std::int64_t> number = parse_integer(part);
        if (!number || *number < low || *number > high)
            throw wrong_flag(flag,
                             fmt::format("got {}, need whole numbers from {} to {}, "
                                         "with commas between",
                                         in_quotes(part), low, high));
        numbers.push_back(static_cast<int>(*number));
    }
    std::sort(numbers.begin(), numbers.end());
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    return numbers;
}

/// Thresholds, the largest first.
std::vector<double> thresholds_of(const std::string& list)
{
    std::vector<double> numbers;
    for (const std::string& part : parts_of(list))
    {
        const std::optional<double> number = parse_double(part);
        if (!number || !(*number > 0) || !std::isfinite(*number))
            throw wrong_flag("--thresholds",
                             "got " + in_quotes(part) +
                                 ", need positive numbers (of the diagonal), "
                                 "with commas between");
        numbers.push_back(*number);
    }
    std::sort(numbers.begin(), numbers.end(), std::greater<>());
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    return numbers;
}

std::vector<FieldChoice> fields_of(const std::string& list)
{
    std::vector<FieldChoice> fields;
    for (const std::string& part : parts_of(list))
    {
        const std::optional<FieldChoice> field = field_of_name(part);
        if (!field)
            throw wrong_flag(
                "--interpolators",
                "got " + in_quotes(part) +
                    ", need rbf, blend, closest4, rbf-global, rbf-centres or "
                    "rbf:CORE:SUPPORT:REACH (1 <= CORE, 0 < "
                    "SUPPORT <= REACH <= 64), with commas "
                    "between");
        if (std::find(fields.begin(), fields.end(), *field) == fields.end())
            fields.push_back(*field);
    }
    return fields;
}

SweepSettings sweep_settings(const SweepFlags& flags, const SessionSettings& session)
{
    SweepSettings settings;
    settings.session = session;
    settings.max_depth = session.cells.max_depth;
    if (flags.runs < 1 || flags.runs > kMaxRuns)
        throw wrong_flag("--runs",
                         fmt::format("got {}, need 1 to {}", flags.runs, kMaxRuns));
    settings.runs = static_cast<int>(flags.runs);
    settings.takes_back = flags.takes_back;
    if (flags.takes_back && session.departures == kBotsch07)
        throw Error(Fault::Usage, "--departures compares with botsch07 by itself: leave "
                                  "out --energy, and the scene's");
    if (flags.takes_back && !(flags.thresholds.empty() && flags.interpolators.empty() &&
                              flags.depths.empty() && flags.iterations.empty()))
        throw Error(Fault::Usage,
                    "--departures has its own cells and fields: leave out --thresholds, "
                    "--depths, --interpolators and --iterations");
    if (!flags.thresholds.empty())
        settings.thresholds = thresholds_of(flags.thresholds);
    if (!flags.interpolators.empty())
        settings.fields = fields_of(flags.interpolators);
    settings.depths = flags.depths.empty()
                          ? std::vector{settings.max_depth}
                          : integers_of("--depths", flags.depths, 0, settings.max_depth);
    if (!flags.iterations.empty())
        settings.iteration_limits =
            integers_of("--iterations", flags.iterations, 0, kMaxIterations);
    return settings;
}

/// Where the reports go.
class ReportFolder
{
public:
    /// Throws what writing \p names into it would throw, before any work is done.
    ReportFolder(const std::string& path, const std::vector<std::string>& names,
                 Overwrite overwrite)
        : path_(path), outputs_(overwrite)
    {
        if (path == "-")
            throw wrong_flag("--output", "got -, need a folder: a sweep writes files");
        while (path_.size() > 1 && path_.back() == '/')
            path_.pop_back();
        std::error_code ignored;
        if (fs::is_directory(path_, ignored))
            for (const std::string& name : names)
                check_output(place_of(name), overwrite);
        else if (fs::exists(path_, ignored))
            throw Error(Fault::File, at({path_, 0, ""}, "is a file, need a folder"));
        else
            check_output(path_, Overwrite::No);
    }

    void make() const
    {
        std::error_code problem;
        fs::create_directory(path_, problem);
        if (problem)
            throw Error(Fault::File,
                        at({path_, 0, ""}, "cannot make it: " + problem.message()));
    }
    std::string place_of(const std::string& name) const { return path_ + "/" + name; }
    /// Writes \p name .json, .csv and .html, and the first of them or \p findings on
    /// stdout. \p page: what the page draws beside \p report.
    void write(const std::string& name, const Json& report, const std::string& csv,
               const std::vector<std::string>& findings, Json page, bool is_json)
    {
        page["report"] = report;
        page["findings"] = findings;
        const std::string json = json_text(report), html = place_of(name + ".html");
        outputs_.write(place_of(name + ".json"), json);
        outputs_.write(place_of(name + ".csv"), csv);
        outputs_.write(html, report_page(page));
        outputs_.write(
            "-",
            is_json ? json : fmt::format("{}\n{}\n", fmt::join(findings, "\n"), html));
        outputs_.commit();
    }

private:
    std::string path_;
    OutputSet outputs_;
};

/// The adaptive cells to show: the coarsest that are as good as uniform ones one level
/// above the reference, else the most accurate. Null if there are none.
const SweepRow* row_to_show(const std::vector<SweepRow>& rows)
{
    double goal = 0.0;
    for (const SweepRow& row : rows)
        if (row.is_done() && row.of.kind == SweepKind::Uniform &&
            row.of.depth + 1 == row.of.reference_depth && !(goal > 0))
            goal = row.error.largest;
    const SweepRow* best = nullptr;
    for (const SweepRow& row : rows)
    {
        if (!row.is_done() || row.of.kind != SweepKind::Adaptive || row.of.is_limited ||
            row.of.field != rows[1].of.field)
            continue;
        if (row.error.largest <= goal)
            return &row;
        if (!best || row.error.largest < best->error.largest)
            best = &row;
    }
    return best;
}

/// Three pictures in one, and what is seen in them from left to right; without, why.
Json draw_sweep(const SweepInput& input, const SweepReport& report, bool is_wanted)
{
    const auto picture = [](const std::string& png, const std::string& caption) {
        return Json{{"png", base64_encoded(png)}, {"caption", caption}};
    };
    if (!is_wanted)
        return picture("", "No pictures were asked for.");
    const std::optional<Pictures> pictures = make_pictures();
    if (!pictures)
        return picture("", "No pictures: this build has none (CELLWARP_PICTURE is off).");
    const SweepRow* const row = row_to_show(report.result.rows);
    const SweepRow& shown = row ? *row : report.result.rows.front();
    const Session session = play_case(input, report.settings, shown.of);
    pictures->add(session, session.geometry().samples, false);
    pictures->add(session, report.result.reference, false);
    pictures->add(session, session.deformed().samples, true);
    return picture(
        pictures->png(),
        fmt::format("At rest; the reference's result; the result of {} with its {} cells "
                    "as glass. Grey is fixed, blue free, yellow a handle, purple a pin, "
                    "green stiff.",
                    case_name(shown.of), shown.cells));
}

/// How far a sweep is: runs done, and the present one by its frames.
void show(Progress& progress, const SweepProgress& now)
{
    const double run = (static_cast<double>(now.frame.frames_done) +
                        static_cast<double>(now.frame.step) /
                            (1.0 + static_cast<double>(now.frame.steps))) /
                       static_cast<double>(now.num_frames);
    progress.show((static_cast<double>(now.run - 1) + run) /
                      static_cast<double>(now.num_runs),
                  fmt::format("run {}/{}: {}", now.run, now.num_runs, case_name(now.of)));
}

/// The scenes that ship with the program: beside the build folder, where it is installed,
/// or where the user stands.
std::vector<std::string> shipped_scenes()
{
    std::error_code ignored;
    const fs::path program = program_folder();
    for (const fs::path& folder :
         {program / "../samples", program / "../share/cellwarp/samples",
          fs::path("samples")})
    {
        std::vector<std::string> scenes;
        for (const fs::path& part : {folder, folder / "rods", folder / "flesh"})
            for (const fs::directory_entry& file : fs::directory_iterator(part, ignored))
                if (file.path().extension() == ".json")
                    scenes.push_back(file.path().lexically_normal().string());
        std::sort(scenes.begin(), scenes.end());
        if (!scenes.empty())
            return scenes;
    }
    throw Error(Fault::File, "the sample scenes are not where they ship: name a scene");
}

/// A scene of a user, or of the program.
StabilityCase case_of(const std::string& scene)
{
    StabilityCase of;
    of.group = "scenes";
    of.name = fs::path(scene).stem().string();
    of.path = scene;
    return of;
}

/// Runs scenes, and what is made at the ends of all ranges, which is written into the
/// folder "scenes".
int run_stability(const SweepFlags& flags, const CommonFlags& common)
{
    if (flags.session.has_session() ? extension_of(flags.session.model) != "json"
                                    : !flags.session.model.empty())
        throw wrong_flag("--stability", "runs scenes: name one, or none for all that "
                                        "ship");
    ReportFolder folder(flags.output,
                        {"stability.json", "stability.csv", "stability.html"},
                        common.overwrite());
    std::vector<StabilityCase> cases;
    for (const std::string& scene : flags.session.model.empty()
                                        ? shipped_scenes()
                                        : std::vector{flags.session.model})
        cases.push_back(case_of(scene));
    const auto is_left_out = [&](const std::string& group, const std::string& name)
    {
        return group.find(flags.only) == std::string::npos &&
               name.find(flags.only) == std::string::npos;
    };
    if (flags.session.model.empty()) // else it was asked for by name
        std::erase_if(cases, [&](const StabilityCase& of)
                      { return is_left_out(of.group, of.name); });
    std::vector<ExtremeScene> extremes = extreme_scenes(flags.long_steps);
    // What others are compared with is needed with them.
    std::erase_if(extremes,
                  [&](const ExtremeScene& extreme) {
                      return extreme.of.group != "base" &&
                             is_left_out(extreme.of.group, extreme.of.name);
                  });
    if (cases.empty() && extremes.size() == 1)
        throw wrong_flag("--only", "no case has " + in_quotes(flags.only));
    folder.make();
    ReportFolder scenes(folder.place_of("scenes"), {}, Overwrite::Yes);
    scenes.make();
    for (ExtremeScene& extreme : extremes)
    {
        for (const SceneText& file : extreme.files)
            write_file(scenes.place_of(file.name), file.text, Overwrite::Yes);
        extreme.of.path = scenes.place_of(extreme.of.name + ".json");
        write_file(extreme.of.path, extreme.scene, Overwrite::Yes);
        cases.push_back(extreme.of);
    }
    Progress progress(common);
    const std::vector<StabilityRow> rows = run_stability(
        cases,
        [&](std::size_t k)
        {
            progress.show(static_cast<double>(k) / static_cast<double>(cases.size()),
                          fmt::format("{}/{}: {}", k + 1, cases.size(), cases[k].name));
        });
    progress.end();
    const Json json = stability_json(rows);
    folder.write("stability", json, stability_csv(json), stability_sentences(rows),
                 {{"kind", "stability"}}, common.is_json);
    return std::any_of(rows.begin(), rows.end(),
                       [](const StabilityRow& row) { return !row.faults.empty(); })
               ? 7
               : 0;
}

int run(SweepFlags flags, const CommonFlags& common)
{
    if (flags.is_stability)
        return run_stability(flags, common);
    if (!flags.only.empty())
        throw wrong_flag("--only", "goes with --stability");
    if (flags.session.model.empty())
        throw Error(Fault::Usage, "MODEL is required");
    // A scene's max_depth is for editing; that of the reference is this command's.
    if (!flags.session.settings.cells.max_depth)
        flags.session.settings.cells.max_depth = SweepSettings().max_depth;
    SessionRequest request = read_request(flags.session);
    ReportFolder folder(flags.output, {"report.json", "report.csv", "report.html"},
                        common.overwrite());
    SweepReport report;
    report.scene = flags.session.model;
    report.model = request.scene.model;
    report.settings = sweep_settings(flags, request.settings);
    report.machine = this_machine();
    report.threads = common.threads > 0 ? common.threads : report.machine.cores;
    if (!request.handles || num_frames(*request.handles) == 0)
        throw Error(Fault::Usage,
                    at({flags.session.model, 0, ""},
                       "has no frame, and a sweep needs a deformation to measure (name "
                       "a handle file with frames in the scene or by --handles)"));
    SweepInput input{request.scene.model, request.read, std::move(*request.handles)};
    if (flags.against)
    {
        report.against = *flags.against;
        input.against = read_against(*flags.against, input);
    }

    Progress progress(common);
    report.result = run_sweep(input, report.settings,
                              [&](const SweepProgress& now) { show(progress, now); });
    progress.end();
    std::vector<std::string>& warnings = report.result.warnings;
    warnings.insert(warnings.begin(), request.warnings.begin(), request.warnings.end());
    print_warnings(warnings, common);

    const Json json = sweep_json(report);
    const Json picture = draw_sweep(input, report, !flags.has_no_pictures);
    folder.make();
    folder.write("report", json, sweep_csv(json), sweep_sentences(report),
                 {{"kind", "sweep"}, {"picture", picture}}, common.is_json);
    return report.result.is_converged() ? 0 : 7;
}

/// What a sweep does by itself, or differently, is no flag of it.
void adapt_session_flags(CLI::App& command, SessionFlags& session)
{
    session.add_to(command);
    for (const char* name : {"--threshold", "--preview"})
        command.remove_option(command.get_option(name));
    command.get_option("MODEL")->required(false);
    command.get_option("--max-depth")
        ->description(fmt::format(
            "of the reference and the finest uniform cells; each level takes some eight "
            "times the cells (default {}, whatever the scene says)",
            SweepSettings().max_depth));
    command.get_option("--tight")->description(
        "solve all to a gradient of 1e-10 instead of 1e-6, as the reference is");
    command.get_option("--time")->description(
        "seconds that the solve of one frame may take; not of the reference's");
}

} // namespace

void add_sweep(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<SweepFlags>();
    const SweepSettings defaults;
    CLI::App* command = app.add_subcommand(
        "sweep",
        "Error against run time: runs a session with many choices of cells and compares "
        "each with a reference.\n\n"
        "  cellwarp sweep samples/creature.json -o creature-sweep\n"
        "  cellwarp sweep scan.ply --handles bend.handles -o out --thresholds 1e-2,1e-3 "
        "--runs 5\n\n"
        "Writes report.json, report.csv and report.html. The reference: uniform cells at "
        "the deepest level, rbf, a gradient of 1e-10. A run that a budget or its regions "
        "forbid gets a row that says so. Exit code 7: a run, but one stopped by "
        "--iterations, did not converge, or could not be done.\n");
    adapt_session_flags(*command, flags->session);
    command
        ->add_option("-o,--output", flags->output,
                     "folder of the reports, made where it is missing")
        ->required();
    command->add_option("--thresholds", flags->thresholds,
                        fmt::format("of adaptive cells, of the diagonal (default {:g})",
                                    fmt::join(defaults.thresholds, ",")));
    command->add_option("--depths", flags->depths,
                        "deepest levels of adaptive cells, up to --max-depth (default "
                        "that alone)");
    command->add_option("--interpolators", flags->interpolators,
                        "of rbf, blend, closest4, rbf-global, rbf-centres (through the "
                        "cells' centres alone) and rbf:CORE:SUPPORT:REACH, "
                        "the local one with clusters of other sizes, in cells (rbf: "
                        "3:2:2.5); each is also compared with the finest of them of the "
                        "same poses, rbf-global or else rbf (default rbf,blend)");
    command->add_option("--iterations", flags->iterations,
                        "limits of one frame's iterations, each tried with all cells and "
                        "interpolators beside none (default none)");
    command->add_option("--against", flags->against,
                        "a result from elsewhere, samples like the model's in any format "
                        "that is read: each run's distance from it, at the most and RMS, "
                        "of the diagonal (columns against_max and against_rms)");
    command->add_option(
        "--runs", flags->runs,
        fmt::format("of each case but the reference, for medians (default {})",
                    defaults.runs));
    command->add_flag("--departures", flags->takes_back,
                      "what each departure from [Botsch07] brings: instead of "
                      "thresholds, the session with each of them taken back alone, and "
                      "with all (--energy botsch07), in uniform and adaptive cells "
                      "(column without)");
    command->add_flag(
        "--stability", flags->is_stability,
        "the extremes instead: the scene, or all that ship, and scenes at "
        "the ends of stiffness, rotation, distance, scale, size and step, "
        "which are left in the folder scenes; each twice, with what a "
        "stable method keeps. Writes stability.json, stability.csv and "
        "stability.html; exit code 7: a case ends otherwise than documented, or misses a "
        "gate");
    command
        ->add_option("--long-steps", flags->long_steps,
                     fmt::format("of --stability: steps of its longest runs in time "
                                 "(default {})",
                                 flags->long_steps))
        ->check(CLI::Range(std::int64_t(100), std::int64_t(100000000)));
    command->add_option("--only", flags->only,
                        "of --stability: cases whose group or name has this in it");
    command->add_flag("--no-pictures", flags->has_no_pictures,
                      "no pictures in report.html");
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp::core
