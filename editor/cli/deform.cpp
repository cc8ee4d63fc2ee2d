// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp deform: one scripted edit session from files to files.
#include <algorithm>
#include <cassert>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "editor/cli/command.h"
#include "editor/cli/output_name.h"
#include "editor/cli/progress.h"
#include "editor/cli/rods_json.h"
#include "editor/cli/session_flags.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/animation_file.h"
#include "io/formats/geometry_file.h"
#include "io/formats/geometry_output.h"
#include "library/session/body.h"
#include "library/session/holding_warnings.h"
#include "library/session/json.h"
#include "library/session/pass_through.h"
#include "library/session/peak_memory.h"
#include "library/session/sample_normals.h"
#include "library/session/session_json.h"
#include "library/session/volume.h"
#include "library/study/sweep.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

struct DeformFlags
{
    SessionFlags session;
    std::string output, field;
    bool converts = false;

    Conversion conversion() const
    {
        return converts ? Conversion::Yes : Conversion::IfAsked;
    }
};

std::vector<std::int64_t> frame_numbers(const HandleFile& handles)
{
    std::vector<std::int64_t> numbers;
    for (const Stage& stage : handles.stages)
        for (const FrameStatement& frame : stage.frames)
            numbers.push_back(frame.number);
    return numbers;
}

/// Frames a second of those that no keys give a time.
constexpr double kFramesASecond = 24.0;

/// When each frame is shown [s], from 0 on.
std::vector<double> frame_times(const HandleFile& handles)
{
    std::vector<double> times;
    for (const Stage& stage : handles.stages)
        for (const FrameStatement& frame : stage.frames)
            times.push_back(
                frame.time.value_or(static_cast<double>(frame.number) / kFramesASecond));
    const double first = times.empty() ? 0.0 : times.front();
    for (double& time : times)
        time -= first;
    return times;
}

bool has_joints(const HandleFile& handles)
{
    return std::any_of(handles.stages.begin(), handles.stages.end(),
                       [](const Stage& stage) { return !stage.joints.empty(); });
}

/// Whether all frames go into one file, as far as the names tell.
bool is_animation(const OutputName& name, const std::string& model,
                  const HandleFile& handles)
{
    return is_animation_format(extension_of(name.of(0)), extension_of(model),
                               !has_joints(handles));
}

/// Refuses what cannot be written before any work is done.
void check_outputs(const OutputName& name, const DeformFlags& flags,
                   const std::string& model, const HandleFile& handles,
                   const CommonFlags& common)
{
    const std::string& output = flags.output;
    const std::vector<std::int64_t> frames = frame_numbers(handles);
    if (is_animation(name, model, handles))
    {
        if (name.has_frame())
            throw wrong_flag("--output",
                             "got " + in_quotes(output) +
                                 ": all frames go into this one file, leave out "
                                 "{frame}");
        if (frames.empty())
            throw wrong_flag("--output",
                             "there is no frame for " + in_quotes(output) + " to show");
        return check_output(output, common.overwrite());
    }
    if (!name.has_frame())
        check_output(output, common.overwrite());
    if (output != "-")
        check_output_format(name.of(0), extension_of(model), flags.conversion());
    if (name.has_frame())
        for (const std::int64_t frame : frames)
            check_output(name.of(frame), common.overwrite());
}

/// The same for --save-field.
void check_field_output(const std::string& path, const std::vector<std::int64_t>& frames,
                        const CommonFlags& common)
{
    if (extension_of(path) != "cwf")
        throw wrong_flag(
            "--save-field",
            fmt::format("got {}, need a name that ends in .cwf", in_quotes(path)));
    if (frames.empty())
        throw wrong_flag("--save-field", "the handle file has no frame, so there "
                                         "is no field");
    check_output(path, common.overwrite());
}

/// What only the model tells.
void check_model_outputs(const OutputName& name, const GeometryFile& model,
                         const std::vector<std::int64_t>& frames, Conversion conversion,
                         const CommonFlags& common)
{
    if (name.of(0) != "-")
        check_output_format(name.of(0), model.geometry.format, conversion);
    if (!frames.empty() && !model.geometry.not_writable.empty() &&
        !is_written_plain(name.of(0), model.geometry.format))
        throw malformed({model.path, 0, ""},
                        "cannot be written: " + model.geometry.not_writable);
    if (!name.has_frame())
        check_geometry_output(name.of(0), model, common.overwrite());
    else
        for (const std::int64_t frame : frames)
            check_geometry_output(name.of(frame), model, common.overwrite());
}

/// How the cells of the session's last stage came out.
void add_cells(Json& json, const Session& session)
{
    const CellSystem* const system = session.system();
    std::vector<int> per_depth;
    int free_cells = 0;
    if (system)
        for (std::size_t c = 0; c < system->body().cells.size(); ++c)
        {
            const std::size_t leaf = idx(system->body().cells.cells[c].leaf);
            const std::size_t level = idx(system->body().octree.leaves()[leaf].level);
            per_depth.resize(std::max(per_depth.size(), level + 1), 0);
            ++per_depth[level];
            free_cells += system->region_of_cell()[c] < 0;
        }
    json["cells"] = system ? system->body().cells.size() : 0;
    json["free_cells"] = free_cells;
    json["depth"] = per_depth.empty() ? 0 : static_cast<int>(per_depth.size()) - 1;
    json["cells_per_depth"] = per_depth;
    if (!system)
        return;
    const Material& material = system->rest().material;
    const double diagonal = system->rest().frame.diagonal();
    json["across"] = system->rest().across;
    json["faces_of_glue"] = system->body().cells.faces.size();
    const PartsByHold parts = parts_by_hold(*system);
    json["parts"] = {
        {"held", parts.held}, {"follow", parts.follow}, {"stay", parts.stay}};
    json["groups_of_cells"] = system->minimizer().multigrid().sizes();
    json["material"] = {{"inside", inside_name(material.method)},
                        {"voxel", material.grid.shape().voxel() / diagonal},
                        {"sealed_up_to", 2.0 * material.seal_radius / diagonal},
                        {"joins_below", material.joins_below / diagonal}};
}

Json field_json(const Session& session, const std::string& release)
{
    const Field* const field = session.field();
    const CellSystem* const system = session.system();
    if (!field || field->parts().num_centres == 0)
        return {{"kind", "blend"},
                {"centres", system ? system->body().cells.size() : 0},
                {"clusters", 0},
                {"residual", 0.0}};
    return {{"kind", release},
            {"centres", field->parts().num_centres},
            {"clusters", field->num_clusters()},
            {"residual", field->parts().residual / system->rest().frame.diagonal()}};
}

Json volume_json(const std::optional<Volume>& volume)
{
    return volume ? Json{{"before", volume->before}, {"after", volume->after}}
                  : Json(nullptr);
}

/// Milliseconds of the stages of the whole run.
struct RunTimes
{
    double load = 0.0, cells = 0.0, solve = 0.0, field = 0.0, write = 0.0, volume = 0.0,
           intersections = 0.0;
};

/// What a session leaves to be told when it is over, and its memory free.
struct Outcome
{
    Json json, unused;
    std::string made, pins; ///< for people
    std::shared_ptr<const DeformedSamples> deformed;
    bool is_converged = true;
    bool is_shell = false; ///< a sheet was bent as a shell
};

/// Where the surface passes through itself after the last frame, beside the model at
/// rest; with a warning of what is new.
Json intersections_json(const Geometry& geometry, const Outcome& outcome,
                        bool counts_rest, bool has_contact,
                        std::vector<std::string>& warnings)
{
    const PassThrough seen = pass_through(geometry, outcome.deformed->samples,
                                          {counts_rest, has_contact, outcome.is_shell});
    if (!seen.warning.empty())
        warnings.push_back(seen.warning);
    return seen.now && seen.rest
               ? Json{{"rest", seen.rest->all}, {"new", seen.now->fresh}}
               : Json(nullptr);
}

/// Sums the frames, and warns of those that did not converge or left samples behind.
bool sum_frames(const Session& session, RunTimes& ms, std::vector<std::string>& warnings)
{
    bool is_converged = true;
    for (const FrameReport& report : session.frames())
    {
        ms.cells += report.cells_ms;
        ms.solve += report.solve_ms;
        ms.field += report.fit_ms + report.apply_ms;
        is_converged = is_converged && report.is_converged();
        for (std::string& warning : convergence_warnings(report))
            warnings.push_back(std::move(warning));
    }
    return is_converged;
}

/// What has been made, for people.
std::string made_line(const OutputName& output, const Session& session)
{
    std::string line = output.of(0);
    if (line == "-")
        line = "done";
    const std::vector<FrameReport>& frames = session.frames();
    if (output.has_frame() && !frames.empty())
        line = frames.size() == 1
                   ? output.of(frames.front().frame)
                   : fmt::format("{} to {} ({} files)", output.of(frames.front().frame),
                                 output.of(frames.back().frame), frames.size());
    if (session.system())
        line += fmt::format(": {} cells", session.system()->body().cells.size());
    return line;
}

/// What pins did in the last frame, for people.
std::string pins_line(const Session& session)
{
    std::string line;
    if (!session.frames().empty())
        for (const PinReport& pin : session.frames().back().pins)
            line += fmt::format(", {} turned by {:.1f}°", pin.name, pin.degrees);
    return line;
}

/// How it all ended, for people.
std::string closing_line(const Outcome& outcome, const std::optional<Volume>& volume,
                         double seconds, std::size_t num_warnings)
{
    std::string line = fmt::format("{}, {:.2f} s", outcome.made, seconds);
    if (volume && volume->before != 0.0)
        line += fmt::format(", volume {:+.2f} %",
                            100.0 * (volume->after / volume->before - 1.0));
    line += outcome.pins;
    if (!outcome.is_converged)
        line += ", not converged";
    if (num_warnings > 0)
        line += fmt::format(", {} warning{}", num_warnings, num_warnings > 1 ? "s" : "");
    return line + "\n";
}

/// All that the session tells, in the order of the documentation.
Json session_json(const Session& session, const SessionRequest& request)
{
    Json json = Json::object();
    json["model"] = request.scene.model;
    json["samples"] = session.geometry().samples.size();
    json["faces"] = session.geometry().num_faces();
    add_cells(json, session);
    json["frames"] = Json::array();
    for (const FrameReport& report : session.frames())
        json["frames"].push_back(frame_json(report));
    json["field"] = field_json(session, field_name(request.settings.field));
    json["rods"] = rods_json(session.rods());
    json["skeleton"] = skeleton_json(session);
    return json;
}

/// The edit itself, its results written: those of all frames to \p animation, unless
/// it is null. What is not one file of many frames is in \p outputs, on the disk. Adds to
/// \p ms and to \p warnings.
Outcome run_session(const DeformFlags& flags, const CommonFlags& common,
                    const OutputName& name, SessionRequest& request,
                    const std::shared_ptr<const GeometryFile>& model,
                    AnimationFile* animation, OutputSet& outputs, RunTimes& ms,
                    std::vector<std::string>& warnings)
{
    const std::vector<std::int64_t> frames = frame_numbers(*request.handles);
    Progress progress(common, frames.size());
    SessionSettings settings = request.settings;
    settings.watch = [&](const FrameProgress& now) { progress.show(now); };
    const Clock::time_point build_start = Clock::now();
    Session session(geometry_of(model), std::move(*request.handles), settings);
    ms.cells = ms_since(build_start);
    const auto timed = [&](const auto& write)
    {
        const Clock::time_point write_start = Clock::now();
        write();
        ms.write += ms_since(write_start);
    };
    const auto write = [&](const std::string& path, OutputSet& to)
    {
        timed(
            [&]
            {
                const std::size_t num_split =
                    write_geometry(path, *model, session.deformed(), to);
                if (num_split > 0)
                    warnings.push_back(
                        fmt::format("{}: {} normals were split: their corners need "
                                    "different directions now",
                                    path, num_split));
            });
    };
    for (std::size_t i = 0; i < frames.size(); ++i)
    {
        session.next_frame(name.has_frame() || animation || i + 1 == frames.size());
        if (animation)
            animation->add(session.deformed().samples);
        else if (name.has_frame())
        {
            OutputSet frame(common.overwrite());
            write(name.of(frames[i]), frame);
            timed([&] { frame.commit(); });
        }
    }
    if (animation)
        timed([&] { animation->finish(); });
    else if (!name.has_frame())
        write(flags.output, outputs);
    timed(
        [&]
        {
            if (!flags.field.empty())
                outputs.write(flags.field, field_bytes(session.field_file()));
            outputs.finish();
        });
    progress.end();

    Outcome outcome;
    outcome.is_converged = sum_frames(session, ms, warnings);
    warnings.insert(warnings.begin(), session.warnings().begin(),
                    session.warnings().end());
    if (common.is_json)
    {
        outcome.json = session_json(session, request);
        outcome.unused = unused_parts(session.parts());
    }
    else
    {
        outcome.made = made_line(name, session);
        outcome.pins = pins_line(session);
    }
    outcome.deformed = session.shared_deformed();
    const CellSystem* const system = session.system();
    outcome.is_shell = system && !system->rest().is_flat() &&
                       system->rest().material.method == InsideMethod::None;
    return outcome;
}

int run(const DeformFlags& flags, const CommonFlags& common)
{
    const Clock::time_point start = Clock::now();
    check_stdout(flags.output, common);
    const OutputName name(flags.output);
    SessionRequest request = read_request(flags.session);
    if (!request.handles)
        request.handles.emplace();
    const std::vector<std::int64_t> frames = frame_numbers(*request.handles);
    check_outputs(name, flags, request.scene.model, *request.handles, common);
    if (!flags.field.empty())
        check_field_output(flags.field, frames, common);
    request.settings.keeps_fields = !flags.field.empty();

    RunTimes ms;
    const auto model =
        std::make_shared<GeometryFile>(read_geometry(request.scene.model, request.read));
    // The mesh of a skinned glTF, posed by joints, is written as one that moves.
    const bool is_patched =
        !has_joints(*request.handles) ||
        (model->geometry.not_writable.empty() && !is_skinned(model->geometry));
    const bool moves = is_animation_format(extension_of(name.of(0)),
                                           model->geometry.format, is_patched) &&
                       !name.has_frame() && !frames.empty();
    OutputSet outputs(common.overwrite());
    std::optional<AnimationFile> animation;
    std::vector<TextureCoordinate> texture;
    if (moves)
    {
        texture = texture_coordinates(*model);
        animation.emplace(flags.output, outputs, model->geometry,
                          frame_times(*request.handles),
                          normals_to_write(flags.output, model->geometry), texture);
    }
    else
        check_model_outputs(name, *model, frames, flags.conversion(), common);
    std::vector<std::string> warnings = request.warnings;
    if (moves || is_written_plain(name.of(0), model->geometry.format))
        if (std::string note =
                left_out_note(name.of(0), model->geometry, !texture.empty());
            !note.empty())
            warnings.push_back(std::move(note));
    ms.load = ms_since(start);
    Outcome outcome =
        run_session(flags, common, name, request, model,
                    animation ? &*animation : nullptr, outputs, ms, warnings);

    // All is on the disk, and nobody else holds the model any more: its text is let go.
    assert(model.use_count() == 1);
    std::string().swap(model->bytes);
    const Clock::time_point volume_start = Clock::now();
    std::optional<Volume> volume;
    if (common.is_json || !common.is_quiet)
        volume = enclosed_volumes(model->geometry, outcome.deformed->samples);
    ms.volume = ms_since(volume_start);
    const Clock::time_point intersections_start = Clock::now();
    const Json intersections =
        intersections_json(model->geometry, outcome, common.is_json,
                           request.settings.cells.has_contact, warnings);
    ms.intersections = ms_since(intersections_start);
    print_warnings(warnings, common);
    if (common.is_json)
    {
        Json& json = outcome.json;
        json["volume"] = volume_json(volume);
        json["self_intersections"] = intersections;
        json["ms"] = {{"load", ms.load},
                      {"cells", ms.cells},
                      {"solve", ms.solve},
                      {"field", ms.field},
                      {"write", ms.write},
                      {"volume", ms.volume},
                      {"intersections", ms.intersections},
                      {"total", ms_since(start)}};
        json["peak_rss_mb"] = peak_memory_mb();
        json["unused"] = outcome.unused;
        json["warnings"] = warnings;
        outputs.write("-", json_text(json));
    }
    outputs.commit();
    if (!common.is_json && !common.is_quiet)
        say(closing_line(outcome, volume, 1e-3 * ms_since(start), warnings.size()));
    return outcome.is_converged ? 0 : 7;
}

} // namespace

void add_deform(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<DeformFlags>();
    CLI::App* command = app.add_subcommand(
        "deform",
        "One scripted edit session: handles fix, grab and move parts; the rest "
        "follows.\n\n"
        "  cellwarp deform samples/bar.json -o bent.obj\n"
        "  cellwarp deform scan.ply --handles bend.handles -o 'bent-{frame:04}.ply' "
        "--json\n");
    flags->session.add_to(*command);
    command
        ->add_option(
            "-o,--output", flags->output,
            "result, in the model's format (of one that is only read: .obj or .ply); "
            "{frame} or {frame:04}: one a frame; -: stdout; all frames in one file that "
            "moves: .glb (of another format, or of a skinned one that joints pose), "
            ".pc2, .mdd")
        ->required();
    command->add_flag("--convert", flags->converts,
                      "the result may have another format than the model: plain geometry "
                      "as .obj, .ply, .off, .stl or .xyz");
    command->add_option("--save-field", flags->field,
                        "keeps the deformation (of all commits and the last frame) as "
                        "FILE.cwf, for cellwarp apply");
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp::core
