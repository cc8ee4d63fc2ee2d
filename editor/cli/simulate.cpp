// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp simulate: a scene in time, frames out.
#include <algorithm>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "editor/cli/command.h"
#include "editor/cli/output_name.h"
#include "editor/cli/progress.h"
#include "editor/cli/simulation_json.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/animation_file.h"
#include "io/formats/geometry_file.h"
#include "io/formats/geometry_output.h"
#include "io/formats/plain_mesh.h"
#include "library/session/json.h"
#include "library/session/peak_memory.h"
#include "library/session/sample_normals.h"
#include "octree/base/clock.h"

namespace cellwarp::core
{

namespace
{

constexpr std::int64_t kMostFiles = 1'000'000; ///< one a frame
constexpr std::int64_t kMostTold = 10;         ///< frames that did not converge

struct SimulateFlags
{
    std::string scene, output, rods;
    bool writes_lines = false; ///< rods, not as tubes
    int around = 12;           ///< corners of a tube
    bool is_tight = false;
};

/// The rods' middles as an OBJ of lines. \p unit: of the file [m].
std::string lines_of(const ObjectSimulation& objects, double unit)
{
    std::string text = "# cellwarp simulate\n";
    std::size_t first = 1;
    for (const SimulatedRod& rod : objects.rods(kPlacesOfCurve))
    {
        text += "o " + rod.name + "\n";
        for (const Eigen::Vector3d& p : rod.curve)
            text += fmt::format("v {} {} {}\n", p.x() / unit, p.y() / unit, p.z() / unit);
        text += "l";
        for (std::size_t k = 0; k < rod.curve.size(); ++k)
            text += fmt::format(" {}", first + k);
        text += "\n";
        first += rod.curve.size();
    }
    return text;
}

/// Objects as a file of a name.
std::string objects_file(const std::string& name, const ObjectSimulation& objects,
                         double unit, const SimulateFlags& flags)
{
    if (flags.writes_lines)
        return lines_of(objects, unit);
    Geometry surface = objects.surface(flags.around);
    for (Eigen::Vector3d& x : surface.samples)
        x /= unit;
    const std::string extension = extension_of(name);
    return plain_mesh_bytes(surface, {surface.samples, {}},
                            extension.empty() ? "obj" : extension);
}

/// Refuses what cannot be written, before any work is done. \p flag: that names it.
void check_rods_output(const std::string& output, const char* flag,
                       const SimulateFlags& flags)
{
    if (output != "-" && !(flags.writes_lines ? extension_of(output) == "obj"
                                              : is_plain_format(extension_of(output))))
        throw wrong_flag(flag,
                         "got " + in_quotes(output) +
                             (flags.writes_lines ? ", lines are written as .obj"
                                                 : ", rods are written as .obj or .ply"));
}

/// The same for all files of one name.
void check_files(const OutputName& name, const Simulation& simulation, bool is_model,
                 const CommonFlags& common)
{
    const std::int64_t first = name.has_frame() ? 0 : simulation.last_frame();
    if (simulation.last_frame() - first > kMostFiles)
        throw Error(Fault::Usage,
                    fmt::format("{} files of frames are more than {}: raise "
                                "simulate.every, or write one file that "
                                "moves",
                                simulation.last_frame() - first, kMostFiles));
    for (std::int64_t frame = first; frame <= simulation.last_frame(); ++frame)
        if (is_model)
            check_geometry_output(name.of(frame), *simulation.model(),
                                  common.overwrite());
        else
            check_output(name.of(frame), common.overwrite());
}

void check_flags(const SimulateFlags& flags, const CommonFlags& common)
{
    if (flags.output.empty() && flags.rods.empty() && !common.is_json)
        throw Error(Fault::Usage, "simulate needs -o, or --json");
    check_stdout(flags.output, common);
    if (flags.rods == "-")
        throw wrong_flag("--rods", "need the name of a file");
}

/// Whether all frames of the model go into one file.
bool is_animation(const SimulateFlags& flags, const Simulation& simulation)
{
    return simulation.model() && !simulation.is_static() &&
           is_animation_format(extension_of(flags.output),
                               simulation.model()->geometry.format,
                               simulation.model()->geometry.not_writable.empty() &&
                                   !is_skinned(simulation.model()->geometry));
}

void check_model_output(const SimulateFlags& flags, const Simulation& simulation,
                        const CommonFlags& common)
{
    const OutputName name(flags.output);
    if (is_animation(flags, simulation))
    {
        if (name.has_frame())
            throw wrong_flag("--output", "got " + in_quotes(flags.output) +
                                             ": all frames go into this one file, leave "
                                             "out {frame}");
        check_output(flags.output, common.overwrite());
        return;
    }
    const GeometryFile& model = *simulation.model();
    if (flags.output != "-")
        check_output_format(name.of(0), extension_of(model.path));
    if (!model.geometry.not_writable.empty() && is_geometry_format(model.geometry.format))
        throw malformed({model.path, 0, ""},
                        "cannot be written: " + model.geometry.not_writable);
    check_files(name, simulation, true, common);
}

void check_outputs(const SimulateFlags& flags, const Simulation& simulation,
                   const CommonFlags& common)
{
    const bool has_model = simulation.model() != nullptr;
    if (!has_model && !flags.rods.empty())
        throw wrong_flag("--rods",
                         "without a model that they carry, rods are written by -o");
    if (!flags.rods.empty() && !simulation.objects())
        throw wrong_flag("--rods", "the scene has no rods");
    const std::string& rods = has_model ? flags.rods : flags.output;
    if (!rods.empty())
    {
        check_rods_output(rods, has_model ? "--rods" : "--output", flags);
        if (rods != "-")
            check_files(OutputName(rods), simulation, false, common);
    }
    if (has_model && !flags.output.empty())
        check_model_output(flags, simulation, common);
}

/// What went on, frame by frame.
class Record
{
public:
    void add(std::int64_t frame, Simulation& simulation, bool is_told)
    {
        const SimulationReport report = simulation.report();
        for (const std::string& problem : report.problems)
            if (++num_stopped_ <= kMostTold)
                warnings_.push_back(fmt::format("frame {}, {}", frame, problem));
        if (is_told)
            frames_.push_back(moment_json(frame, report, simulation));
    }
    bool is_converged() const { return num_stopped_ == 0; }
    Json take_frames() { return std::move(frames_); }
    std::vector<std::string> warnings() const
    {
        std::vector<std::string> all = warnings_;
        if (num_stopped_ > kMostTold)
            all.push_back(fmt::format("and {} times more", num_stopped_ - kMostTold));
        return all;
    }

private:
    Json frames_ = Json::array();
    std::vector<std::string> warnings_;
    std::int64_t num_stopped_ = 0;
};

/// Writes what was asked for, frame by frame. Files of single frames appear at once;
/// commit() gives all others their names, together with what is written to stdout.
class Outputs
{
public:
    Outputs(const SimulateFlags& flags, const CommonFlags& common,
            const Simulation& simulation)
        : flags_(flags), common_(common), name_(flags.output), rods_(flags.rods),
          set_(common.overwrite())
    {
        if (!is_animation(flags, simulation))
            return;
        std::vector<double> times;
        for (std::int64_t frame = 0; frame <= simulation.last_frame(); ++frame)
            times.push_back(simulation.time().time_of(frame));
        const Geometry& geometry = simulation.model()->geometry;
        const std::vector<TextureCoordinate> texture =
            texture_coordinates(*simulation.model());
        animation_.emplace(flags.output, set_, geometry, std::move(times),
                           normals_to_write(flags.output, geometry), texture);
        if (std::string note = left_out_note(flags.output, geometry, !texture.empty());
            !note.empty())
            warnings_.push_back(std::move(note));
    }

    const std::vector<std::string>& warnings() const { return warnings_; }
    bool want_samples(bool is_last) const
    {
        return animation_ || is_wanted(name_, flags_.output, is_last);
    }
    void write(std::int64_t frame, Simulation& simulation)
    {
        const bool is_last = frame == simulation.last_frame();
        const bool has_model = simulation.model() != nullptr;
        OutputSet frames(common_.overwrite());
        const auto set_of = [&](const OutputName& name) -> OutputSet&
        { return name.has_frame() ? frames : set_; };
        if (animation_)
        {
            animation_->add(simulation.deformed().samples);
            if (is_last)
                animation_->finish();
        }
        else if (has_model && is_wanted(name_, flags_.output, is_last))
            write_geometry(name_.of(frame), *simulation.model(), simulation.deformed(),
                           set_of(name_));
        const OutputName& of_rods = has_model ? rods_ : name_;
        if (is_wanted(of_rods, has_model ? flags_.rods : flags_.output, is_last))
            set_of(of_rods).write(of_rods.of(frame),
                                  objects_file(of_rods.of(frame), *simulation.objects(),
                                               simulation.unit(), flags_));
        frames.commit();
        if (is_last)
            set_.finish();
    }
    void commit(const std::string& for_stdout)
    {
        set_.write("-", for_stdout);
        set_.commit();
    }

private:
    static bool is_wanted(const OutputName& of, const std::string& text, bool is_last)
    {
        return !text.empty() && (of.has_frame() || is_last);
    }

    const SimulateFlags& flags_;
    const CommonFlags& common_;
    const OutputName name_, rods_;
    OutputSet set_;
    std::optional<AnimationFile> animation_;
    std::vector<std::string> warnings_;
};

int run(const SimulateFlags& flags, const CommonFlags& common)
{
    const Clock::time_point start = Clock::now();
    check_flags(flags, common);
    Progress progress(common);
    double share = 0.0; ///< of the steps that is done
    SimulationInput input = read_simulation(scene_or_model(flags.scene));
    input.is_tight = flags.is_tight;
    input.settings.watch = [&](const FrameProgress& now) {
        progress.show(share,
                      fmt::format("cells of frame {}, {}", now.frame, now.iteration));
    };
    Simulation simulation(std::move(input));
    check_outputs(flags, simulation, common);
    Outputs outputs(flags, common, simulation);
    const std::int64_t steps = simulation.num_steps();
    const double load_ms = ms_since(start);

    Record record;
    double write_ms = 0.0;
    const Clock::time_point begin = Clock::now();
    const auto end_frame = [&](std::int64_t frame)
    {
        record.add(frame, simulation, common.is_json);
        const Clock::time_point write_start = Clock::now();
        outputs.write(frame, simulation);
        write_ms += ms_since(write_start);
    };
    const auto show = [&]
    {
        const std::int64_t done = simulation.steps_done();
        share = static_cast<double>(done) / static_cast<double>(steps);
        progress.show(share, fmt::format("step {} of {}", done, steps));
    };
    if (!simulation.is_static())
        end_frame(0);
    for (std::int64_t frame = simulation.is_static() ? 0 : 1;
         frame <= simulation.last_frame(); ++frame)
    {
        simulation.next_frame(show,
                              outputs.want_samples(frame == simulation.last_frame()));
        end_frame(frame);
    }
    progress.end();
    const double simulate_ms = ms_since(begin) - write_ms;
    std::vector<std::string> warnings = simulation.warnings();
    for (const std::vector<std::string>& more : {outputs.warnings(), record.warnings()})
        warnings.insert(warnings.end(), more.begin(), more.end());
    print_warnings(warnings, common);
    std::string text;
    if (common.is_json)
    {
        Json json = Json::object();
        json["frames"] = record.take_frames();
        json["steps"] = simulation.steps_done();
        json["ms"] = {{"load", load_ms},
                      {"simulate", simulate_ms},
                      {"write", write_ms},
                      {"total", ms_since(start)}};
        json["peak_rss_mb"] = peak_memory_mb();
        add_summary(simulation, json);
        json["warnings"] = warnings;
        text = json_text(json);
    }
    outputs.commit(text);
    return record.is_converged() ? 0 : kNotConverged;
}

} // namespace

void add_simulate(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<SimulateFlags>();
    CLI::App* const command = app.add_subcommand(
        "simulate",
        "A scene in time, frames out: spline rods and the model whose cells they carry, "
        "or flesh that follows a skeleton.\n\n"
        "  cellwarp simulate samples/rods/cantilever.json -o bent.obj\n"
        "  cellwarp simulate samples/rods/pendulum.json -o 'swing-{frame:03}.obj'\n"
        "  cellwarp simulate samples/flesh/walk.json -o walk.glb\n");
    command->add_option("SCENE", flags->scene, "scene with simulate (json)")->required();
    command->add_option("-o,--output", flags->output,
                        "rods as tubes (.obj, .ply), or the model, in its format: the "
                        "last frame; {frame} or {frame:04}: one a frame; -: stdout, rods "
                        "as OBJ; all frames of a model in one file that moves: .glb, "
                        ".pc2, .mdd");
    command->add_option(
        "--rods", flags->rods,
        "rods beside the model that they carry, in its unit (.obj, .ply)");
    command->add_flag("--lines", flags->writes_lines,
                      "rods as lines along their middle, not as tubes");
    command->add_option("--around", flags->around, "corners around a tube (default 12)")
        ->check(CLI::Range(3, 1000));
    command->add_flag("--tight", flags->is_tight,
                      "flesh: linear systems to 1e-10 instead of 1e-3");
    command->callback([=, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp::core
