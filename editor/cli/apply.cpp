// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp apply: a saved deformation for any other data of the same space, streamed.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "editor/cli/command.h"
#include "editor/cli/progress.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/geometry_file.h"
#include "library/session/json.h"
#include "library/session/peak_memory.h"
#include "library/stream/apply.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

struct ApplyFlags
{
    std::string field, output, format, columns, shard, list;
    std::vector<std::string> inputs;
    std::optional<std::string> max_memory;
    int jobs = 1;
    bool resumes = false, fails_fast = false;
};

/// Which of the inputs are this run's: every count-th from the index-th on.
struct Shard
{
    std::size_t index = 1, count = 1;
};

Shard parse_shard(const std::string& text)
{
    if (text.empty())
        return {};
    const std::size_t slash = text.find('/');
    const std::optional<std::int64_t> index = parse_integer(text.substr(0, slash));
    const std::optional<std::int64_t> count =
        slash == std::string::npos ? std::nullopt : parse_integer(text.substr(slash + 1));
    if (!index || !count || *index < 1 || *index > *count)
        throw wrong_flag("--shard", "got " + in_quotes(text) +
                                        ", need I/N with 1 <= I <= N, like 3/8");
    return {idx(*index), idx(*count)};
}

std::vector<std::string> lines_of(const std::string& path)
{
    const std::string bytes = read_file(path);
    std::vector<std::string> lines;
    LineReader reader(bytes, 0, true);
    for (std::string_view line; reader.next(line);)
        if (!line.empty())
            lines.emplace_back(line);
    return lines;
}

bool is_folder(const std::string& output)
{
    std::error_code problem;
    const fs::file_status status = fs::status(output, problem);
    if (status.type() == fs::file_type::none)
        throw Error(Fault::File,
                    at({output, 0, ""}, "cannot write: " + problem.message()));
    return output.ends_with('/') || fs::is_directory(status);
}

/// The shard's files, each with its output of the same name.
std::vector<BatchFile> files_in(const std::string& folder,
                                const std::vector<std::string>& inputs,
                                const Shard& shard)
{
    std::set<std::string> names;
    std::vector<BatchFile> files;
    for (std::size_t i = 0; i < inputs.size(); ++i)
    {
        const std::string name = fs::path(inputs[i]).filename().string();
        if (inputs[i] == "-")
            throw Error(Fault::Usage, "stdin has no name for a file in " + folder);
        // All shards look at all names, so that they agree.
        if (!names.insert(name).second)
            throw Error(Fault::Usage,
                        at({inputs[i], 0, ""}, "another input has this name, and "
                                               "both would become " +
                                                   (fs::path(folder) / name).string()));
        std::error_code none;
        if (fs::equivalent(inputs[i], fs::path(folder) / name, none))
            throw Error(Fault::Usage,
                        at({inputs[i], 0, ""}, "its output would be the file itself"));
        if (i % shard.count == shard.index - 1)
            files.push_back({inputs[i], (fs::path(folder) / name).string()});
    }
    return files;
}

/// The program itself, its libraries and threads [byte].
constexpr double kProgramBytes = 25e6;
/// A field file, and what it says, are in memory together once.
constexpr double kBytesPerFieldByte = 2.0;

/// Reads the field within \p settings.max_memory, and takes what it needs off that.
Deformation load_field(const std::string& path, ApplySettings& settings)
{
    double& left = settings.max_memory;
    const auto need = [&](double bytes)
    {
        if (bytes > left)
            throw Error(Fault::Budget,
                        at({path, 0, ""}, "the field needs about " + in_bytes(bytes) +
                                              " (limit " + in_bytes(left) + ")"));
    };
    if (!(left > 0))
        return Deformation(read_field(path), path);
    std::error_code unknown;
    const std::uintmax_t size = fs::file_size(path, unknown);
    need(kProgramBytes +
         (unknown ? 0.0 : kBytesPerFieldByte * static_cast<double>(size)));
    const FieldFile file = read_field(path);
    left -= kProgramBytes;
    Deformation deformation(file, path, left);
    left -= memory_of(file) + deformation.most_kept();
    return deformation;
}

double per_second(std::uint64_t samples, double seconds)
{
    return seconds > 0 ? static_cast<double>(samples) / seconds : 0.0;
}

/// The report as text: \p json and the keys common to one file and many.
std::string report_text(Json json, std::uint64_t samples, double seconds,
                        const Deformation& deformation,
                        const std::vector<std::string>& warnings)
{
    json["samples"] = samples;
    json["seconds"] = seconds;
    json["points_per_second"] = per_second(samples, seconds);
    json["chain_length"] = deformation.num_maps();
    json["peak_rss_mb"] = peak_memory_mb();
    json["warnings"] = warnings;
    return json_text(json);
}

std::vector<std::string> warnings_of(const StreamReport& report,
                                     const std::string& output)
{
    std::vector<std::string> warnings = report.warnings;
    if (report.num_split > 0)
        warnings.push_back(fmt::format("{}: {} normals were split: their corners need "
                                       "different directions now",
                                       output, report.num_split));
    return warnings;
}

ApplySettings settings_of(const ApplyFlags& flags, const CommonFlags& common)
{
    ApplySettings settings;
    settings.format = lower_case(flags.format);
    settings.read.columns = flags.columns;
    settings.overwrite = common.overwrite();
    settings.threads = common.threads;
    settings.jobs = flags.jobs;
    settings.max_memory = memory_limit(flags.max_memory);
    settings.resumes = flags.resumes;
    settings.fails_fast = flags.fails_fast;
    if (!settings.format.empty() && !is_geometry_format(settings.format))
        throw wrong_flag("--format", "got " + in_quotes(flags.format) +
                                         ", need an extension like ply");
    return settings;
}

int apply_one(const ApplyFlags& flags, const CommonFlags& common, ApplySettings settings)
{
    const std::string& input = flags.inputs.front();
    const std::string format =
        settings.format.empty() ? extension_of(input) : settings.format;
    if (input == "-" && settings.format.empty())
        throw Error(Fault::Usage, "stdin does not tell its format (need --format)");
    check_stdout(flags.output, common);
    if (flags.output != "-" && extension_of(flags.output) != format)
        throw Error(Fault::Usage,
                    at({flags.output, 0, ""},
                       fmt::format("the output has the input's format (got {}, need .{})",
                                   in_quotes("." + extension_of(flags.output)), format)));
    check_output(flags.output, common.overwrite());
    const Deformation deformation = load_field(flags.field, settings);
    Progress progress(common);
    settings.watch = [&](double done, const std::string& name)
    { progress.show(done, name); };
    const Clock::time_point start = Clock::now();
    OutputSet outputs(common.overwrite());
    const StreamReport report =
        apply_to_file(deformation, input, flags.output, outputs, settings);
    outputs.finish();
    const double seconds = seconds_since(start);
    progress.end();
    const std::vector<std::string> warnings = warnings_of(report, flags.output);
    print_warnings(warnings, common);
    if (common.is_json)
        outputs.write(
            "-", report_text(
                     {{"field", flags.field}, {"input", input}, {"output", flags.output}},
                     report.samples, seconds, deformation, warnings));
    outputs.commit();
    return 0;
}

std::string name_of(FileStatus status)
{
    switch (status)
    {
    case FileStatus::Done:
        return "done";
    case FileStatus::Skipped:
        return "skipped";
    case FileStatus::Failed:
        return "failed";
    case FileStatus::Stopped:
        return "stopped";
    case FileStatus::Left:
        return "not begun";
    }
    return {};
}

/// Tells every failure and how many there were; the exit code.
int sum_up(const std::vector<BatchFile>& files, const std::vector<FileReport>& reports)
{
    std::size_t failed = 0, stopped = 0, left = 0;
    std::set<Fault> faults;
    for (const FileReport& report : reports)
    {
        stopped += report.status == FileStatus::Stopped;
        left += report.status == FileStatus::Left;
        if (report.status != FileStatus::Failed)
            continue;
        ++failed;
        faults.insert(report.error->fault());
        say(fmt::format("error: {}\n", report.error->what()));
    }
    if (failed == 0)
        return 0;
    say(fmt::format("error: {} of {} files failed{}{}\n", failed, files.size(),
                    stopped > 0 ? fmt::format(", {} were stopped", stopped) : "",
                    left > 0 ? fmt::format(", {} were not begun", left) : ""));
    const bool is_one = faults.size() == 1;
    const Fault fault = *faults.begin();
    return static_cast<int>(is_one && (fault == Fault::File || fault == Fault::Budget)
                                ? fault
                                : Fault::Malformed);
}

int apply_many(const ApplyFlags& flags, const CommonFlags& common, ApplySettings settings)
{
    const Shard shard = parse_shard(flags.shard);
    const std::vector<BatchFile> files = files_in(flags.output, flags.inputs, shard);
    const Deformation deformation = load_field(flags.field, settings);
    std::error_code failed;
    fs::create_directories(flags.output, failed);
    if (failed)
        throw Error(Fault::File,
                    at({flags.output, 0, ""}, "cannot make it: " + failed.message()));
    const std::string name =
        flags.shard.empty()
            ? "cellwarp-manifest.tsv"
            : fmt::format("cellwarp-manifest-{}-of-{}.tsv", shard.index, shard.count);
    Progress progress(common);
    settings.watch = [&](double done, const std::string& input)
    { progress.show(done, input); };
    const Clock::time_point start = Clock::now();
    const std::vector<FileReport> reports = apply_to_batch(
        deformation, files, (fs::path(flags.output) / name).string(), settings);
    const double seconds = seconds_since(start);
    progress.end();

    std::uint64_t samples = 0;
    std::size_t done = 0, skipped = 0;
    std::vector<std::string> warnings;
    Json each = Json::array();
    for (std::size_t i = 0; i < reports.size(); ++i)
    {
        const FileReport& report = reports[i];
        samples += report.stream.samples;
        done += report.status == FileStatus::Done;
        skipped += report.status == FileStatus::Skipped;
        const std::vector<std::string> more = warnings_of(report.stream, files[i].output);
        warnings.insert(warnings.end(), more.begin(), more.end());
        each.push_back({{"input", files[i].input},
                        {"status", name_of(report.status)},
                        {"samples", report.stream.samples},
                        {"seconds", report.seconds}});
        if (report.error)
            each.back()["error"] = error_json(*report.error);
    }
    print_warnings(warnings, common);
    const int exit_code = sum_up(files, reports);
    if (exit_code == 0 && !common.is_quiet)
        say(fmt::format("{} files done, {} skipped\n", done, skipped));
    if (common.is_json)
        write_file(
            "-",
            report_text(
                {{"field", flags.field}, {"output", flags.output}, {"files", each}},
                samples, seconds, deformation, warnings),
            Overwrite::Yes);
    return exit_code;
}

int run(ApplyFlags flags, const CommonFlags& common)
{
    const ApplySettings settings = settings_of(flags, common);
    if (!flags.list.empty())
    {
        const std::vector<std::string> listed = lines_of(flags.list);
        flags.inputs.insert(flags.inputs.end(), listed.begin(), listed.end());
    }
    if (flags.inputs.empty() && flags.list.empty())
        throw Error(Fault::Usage, "no input (need files, or --list)");
    if (is_folder(flags.output))
        return apply_many(flags, common, settings);
    if (flags.inputs.size() != 1)
        throw wrong_flag("--output",
                         fmt::format("got {}, need a folder, like out/, for {} inputs",
                                     in_quotes(flags.output), flags.inputs.size()));
    if (!flags.shard.empty() || flags.resumes || flags.jobs > 1)
        throw wrong_flag("--output", "got " + in_quotes(flags.output) +
                                         ", need a folder with --shard, --resume and "
                                         "--jobs");
    return apply_one(flags, common, settings);
}

} // namespace

void add_apply(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<ApplyFlags>();
    CLI::App* command = app.add_subcommand(
        "apply",
        "A saved deformation for any other data of the same space: a scan, a denser "
        "mesh. Memory does not grow with the input.\n\n"
        "  cellwarp apply bend.cwf scan.ply -o bent.ply\n"
        "  cellwarp apply bend.cwf tiles/*.ply -o bent/ --shard 3/8 --resume\n");
    command->add_option("FIELD", flags->field, "deformation, from deform --save-field")
        ->required();
    command->add_option("INPUT", flags->inputs,
                        "geometry files; -: stdin, where one pass is enough (not an OBJ "
                        "whose faces use normals, a compressed PCD or a glTF)");
    command
        ->add_option("-o,--output", flags->output,
                     "result, in the input's format; -: stdout; a folder: files of the "
                     "same names and cellwarp-manifest.tsv")
        ->required();
    command->add_option("--format", flags->format,
                        "of the inputs, like ply (default: their extension; stdin needs "
                        "it)");
    add_columns(*command, flags->columns);
    command->add_option("--list", flags->list,
                        "file of more inputs, one a line; -: stdin");
    command->add_option("--shard", flags->shard,
                        "I/N: only every N-th input, from the I-th on; the manifest is "
                        "then cellwarp-manifest-I-of-N.tsv");
    command
        ->add_option("--jobs", flags->jobs,
                     "files at once (default 1); they share the "
                     "threads")
        ->check(CLI::Range(1, 64));
    add_max_memory(*command, flags->max_memory);
    command->add_flag("--resume", flags->resumes,
                      "leave out what the manifest says is done with this field, where "
                      "input and output are still the same");
    command->add_flag("--fail-fast", flags->fails_fast, "stop at the first failure");
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp::core
