// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp simulate: rods in time, frames out.
#include "editor/cli/simulate.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "editor/cli/output_name.h"
#include "editor/cli/session_json.h"
#include "editor/session/peak_memory.h"
#include "editor/simulation/carried_model.h"
#include "editor/simulation/simulation.h"
#include "io/geometry_file.h"
#include "io/geometry_output.h"
#include "io/plain_mesh.h"
#include "io/rod_scene.h"
#include "io/text.h"
#include "octree/base/clock.h"

namespace cellwarp
{

namespace
{

constexpr int kPlaces = 33;     ///< of each curve in --json
constexpr int kSheetPlaces = 5; ///< along each side of a sheet
constexpr int kNotConverged = 7;
constexpr std::int64_t kMostTold = 10; ///< frames that did not converge

struct SimulateFlags
{
    std::string scene, output, rods;
    bool writes_lines = false;
    std::int64_t around = 12;
};

/// A scene, and the model that its rods carry, if they do.
struct SceneInTime
{
    RodScene scene;
    Simulation simulation;
    std::shared_ptr<const GeometryFile> model = {};
    std::optional<CarriedModel> carried = {};
    std::vector<std::string> warnings = {};

    /// \p watch: on the way of the cells.
    explicit SceneInTime(const std::string& path,
                         std::function<void(const FrameProgress&)> watch = {})
        : scene(read_rod_scene(path)), simulation(scene), warnings(scene.warnings)
    {
        warnings.insert(warnings.end(), simulation.warnings().begin(),
                        simulation.warnings().end());
        if (!scene.carries())
            return;
        SessionFlags flags;
        flags.model = path;
        SessionRequest request = read_request(flags, true);
        warnings.insert(warnings.end(), request.warnings.begin(), request.warnings.end());
        request.settings.watch = std::move(watch);
        model = std::make_shared<const GeometryFile>(
            read_geometry(request.model, request.read));
        carried.emplace(geometry_of(model),
                        std::move(request.handles).value_or(HandleFile()),
                        request.settings, scene.unit, simulation);
    }
    /// An equilibrium is frame 0.
    std::int64_t last_frame() const
    {
        return simulation.is_static() ? 0 : simulation.last_frame();
    }
    /// Goes on by one; \p wants_samples: of the model.
    void next_frame(const std::function<void()>& show, bool wants_samples)
    {
        simulation.next_frame(show);
        if (carried)
            carried->follow(simulation, wants_samples);
    }
};

Json numbers(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
}

Json frame_json(std::int64_t frame, const SimulationReport& report,
                const Simulation& simulation)
{
    Json rods = Json::array();
    for (const SimulatedRod& rod : simulation.rods(kPlaces))
    {
        Json curve = Json::array();
        for (const Eigen::Vector3d& p : rod.curve)
            curve.push_back(numbers(p));
        rods.push_back({{"name", rod.name},
                        {"length", rod.length},
                        {"curve", std::move(curve)},
                        {"knots", rod.knots},
                        {"sliding", rod.sliding}});
    }
    Json bodies = Json::array();
    for (const SimulatedBody& body : simulation.bodies())
    {
        Json axes = Json::array();
        for (Eigen::Index k = 0; k < 3; ++k)
            axes.push_back(numbers(body.R.col(k)));
        bodies.push_back(
            {{"name", body.name}, {"at", numbers(body.at)}, {"axes", std::move(axes)}});
    }
    Json nets = Json::array();
    for (const SimulatedNet& net : simulation.nets())
    {
        Json points = Json::array();
        for (const Eigen::Vector3d& p : net.points)
            points.push_back(numbers(p));
        nets.push_back({{"name", net.name}, {"points", std::move(points)}});
    }
    Json out = {{"frame", frame},
                {"time", report.time},
                {"energy",
                 {{"kinetic", report.kinetic},
                  {"elastic", report.elastic},
                  {"gravity", report.gravity}}},
                {"momentum", numbers(report.momentum)},
                {"angular_momentum", numbers(report.turning)},
                {"constraint", report.violation},
                {"iterations", report.iterations},
                {"stop", report.stop},
                {"rods", std::move(rods)},
                {"bodies", std::move(bodies)},
                {"nets", std::move(nets)}};
    Json sheets = Json::array();
    for (const SimulatedSheet& sheet : simulation.sheets(kSheetPlaces))
    {
        Json points = Json::array(), sliding = Json::array();
        for (const Eigen::Vector3d& p : sheet.points)
            points.push_back(numbers(p));
        for (const Eigen::Vector3d& at : sheet.sliding)
            sliding.push_back(std::isnan(at.x()) ? Json() : Json{at.x(), at.y()});
        sheets.push_back({{"name", sheet.name},
                          {"points", std::move(points)},
                          {"sliding", std::move(sliding)}});
    }
    if (!sheets.empty())
        out["sheets"] = std::move(sheets);
    if (report.has_contacts)
    {
        out["energy"]["contact"] = report.touching;
        out["contact"] = {{"count", report.contacts},
                          {"nearest", report.nearest ? Json(*report.nearest) : Json()}};
    }
    return out;
}

/// The rods' middles as an OBJ of lines.
std::string lines_of(const Simulation& simulation, double unit)
{
    std::string text = "# cellwarp simulate\n";
    std::size_t first = 1;
    for (const SimulatedRod& rod : simulation.rods(kPlaces))
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

/// \p unit: of the file [m].
std::string bytes_of(const Simulation& simulation, const std::string& name, double unit,
                     const SimulateFlags& flags)
{
    if (flags.writes_lines)
        return lines_of(simulation, unit);
    Geometry surface = simulation.surface(static_cast<int>(flags.around));
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
        throw Error(Fault::Usage,
                    std::string(flag) + ": got " + in_quotes(output) +
                        (flags.writes_lines ? ", lines are written as .obj"
                                            : ", rods are written as .obj or .ply"));
}

/// The same for all files of one name.
void check_files(const OutputName& name, const SceneInTime& in_time, bool is_model,
                 const CommonFlags& common)
{
    const std::int64_t first = name.has_frame() ? 0 : in_time.last_frame();
    for (std::int64_t frame = first; frame <= in_time.last_frame(); ++frame)
        if (is_model)
            check_geometry_output(name.of(frame), *in_time.model, common.overwrite());
        else
            check_output(name.of(frame), common.overwrite());
}

void check_flags(const SimulateFlags& flags, const CommonFlags& common)
{
    if (flags.output.empty() && flags.rods.empty() && !common.is_json)
        throw Error(Fault::Usage, "simulate needs -o, or --json");
    if (flags.output == "-" && common.is_json)
        throw Error(Fault::Usage, "-o - and --json both need stdout");
    if (flags.rods == "-")
        throw Error(Fault::Usage, "--rods: need the name of a file");
}

void check_outputs(const SimulateFlags& flags, const SceneInTime& in_time,
                   const CommonFlags& common)
{
    if (!in_time.carried && !flags.rods.empty())
        throw Error(Fault::Usage,
                    "--rods: without a model that they carry, rods are written by -o");
    const std::string& rods = in_time.carried ? flags.rods : flags.output;
    if (!rods.empty())
    {
        check_rods_output(rods, in_time.carried ? "--rods" : "-o", flags);
        if (rods != "-")
            check_files(OutputName(rods), in_time, false, common);
    }
    if (!in_time.carried || flags.output.empty())
        return;
    const GeometryFile& model = *in_time.model;
    if (flags.output != "-")
        check_output_format(OutputName(flags.output).of(0), extension_of(model.path));
    if (!model.geometry.not_writable.empty() && is_geometry_format(model.geometry.format))
        throw malformed({model.path, 0, ""},
                        "cannot be written: " + model.geometry.not_writable);
    check_files(OutputName(flags.output), in_time, true, common);
}

/// What went on, frame by frame.
class Record
{
public:
    void add(std::int64_t frame, SceneInTime& in_time, bool is_told)
    {
        const SimulationReport report = in_time.simulation.report();
        const Session* const session =
            in_time.carried ? &in_time.carried->session() : nullptr;
        const FrameReport* const cells =
            session && !session->frames().empty() ? &session->frames().back() : nullptr;
        if (!report.is_converged)
        {
            std::string what = report.stopped + ": " + report.stop;
            if (report.violation > 1e-9)
                what +=
                    fmt::format("; constraints are violated by up to {:.3g} (m, or rad)",
                                report.violation);
            warn(frame, what);
        }
        if (cells && cells->solve.stop != Stop::Converged)
            warn(frame, fmt::format("the cells did not converge ({}, gradient {:.3g})",
                                    stop_name(cells->solve.stop), cells->solve.gradient));
        if (!is_told)
            return;
        frames_.push_back(frame_json(frame, report, in_time.simulation));
        if (cells)
            frames_.back()["model"] = frame_json(*cells);
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
    void warn(std::int64_t frame, const std::string& what)
    {
        if (++num_stopped_ <= kMostTold)
            warnings_.push_back(fmt::format("frame {}, {}", frame, what));
    }

    Json frames_ = Json::array();
    std::vector<std::string> warnings_;
    std::int64_t num_stopped_ = 0;
};

/// How many cells each rod carries.
Json carriers_json(const Session& session)
{
    Json carriers = Json::array();
    const CellSystem* const system = session.system();
    for (std::size_t r = 0; system && r < system->regions().size(); ++r)
        if (system->regions()[r].is_led())
            carriers.push_back({{"name", system->regions()[r].name},
                                {"cells", std::count(system->region_of_cell().begin(),
                                                     system->region_of_cell().end(),
                                                     static_cast<int>(r))}});
    return carriers;
}

int run(const SimulateFlags& flags, const CommonFlags& common)
{
    const Clock::time_point start = Clock::now();
    check_flags(flags, common);
    const OutputName name(flags.output), rods(flags.rods);
    Progress progress(common);
    double share = 0.0; ///< of the steps that is done
    SceneInTime in_time(flags.scene,
                        [&](const FrameProgress& now)
                        {
                            progress.show(share, fmt::format("cells of frame {}, {}",
                                                             now.frame, now.iteration));
                        });
    Simulation& simulation = in_time.simulation;
    check_outputs(flags, in_time, common);
    const std::int64_t steps = simulation.num_steps();
    const double load_ms = ms_since(start);

    Record record;
    double write_ms = 0.0;
    const Clock::time_point begin = Clock::now();
    const auto is_wanted =
        [&](const OutputName& of, const std::string& text, bool is_last)
    { return !text.empty() && (of.has_frame() || is_last); };
    const auto end_frame = [&](std::int64_t frame)
    {
        const bool is_last = frame == in_time.last_frame();
        record.add(frame, in_time, common.is_json);
        const Clock::time_point write_start = Clock::now();
        if (in_time.carried && is_wanted(name, flags.output, is_last))
            write_geometry(name.of(frame), *in_time.model,
                           in_time.carried->session().deformed(), common.overwrite());
        const OutputName& of_rods = in_time.carried ? rods : name;
        if (is_wanted(of_rods, in_time.carried ? flags.rods : flags.output, is_last))
            write_file(of_rods.of(frame),
                       bytes_of(simulation, of_rods.of(frame),
                                in_time.carried ? in_time.scene.unit : 1.0, flags),
                       common.overwrite());
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
         frame <= in_time.last_frame(); ++frame)
    {
        in_time.next_frame(show,
                           is_wanted(name, flags.output, frame == in_time.last_frame()));
        end_frame(frame);
    }
    progress.end();
    const double simulate_ms = ms_since(begin) - write_ms;
    std::vector<std::string> warnings = in_time.warnings;
    for (const std::vector<std::string>& more :
         {in_time.carried ? in_time.carried->session().warnings()
                          : std::vector<std::string>(),
          record.warnings()})
        warnings.insert(warnings.end(), more.begin(), more.end());
    print_warnings(warnings, common);
    if (common.is_json)
    {
        Json json;
        json["frames"] = record.take_frames();
        json["steps"] = simulation.steps_done();
        if (in_time.carried)
            json["carriers"] = carriers_json(in_time.carried->session());
        json["ms"] = {{"load", load_ms},
                      {"simulate", simulate_ms},
                      {"write", write_ms},
                      {"total", ms_since(start)}};
        json["peak_rss_mb"] = peak_memory_mb();
        json["unused"] = unused_parts(in_time.carried ? in_time.carried->session().parts()
                                                      : PartCounts{});
        json["warnings"] = warnings;
        write_file("-", json.dump(2) + "\n", Overwrite::Yes);
    }
    return record.is_converged() ? 0 : kNotConverged;
}

} // namespace

std::optional<Film> film_of_rods(const std::string& scene)
{
    if (!has_simulation(scene))
        return std::nullopt;
    const auto in_time = std::make_shared<SceneInTime>(scene);
    const auto frame = std::make_shared<std::int64_t>(0);
    const auto is_converged = std::make_shared<bool>(true);
    const auto draw = [=](std::int64_t wanted)
    {
        constexpr int kAround = 24;
        while (*frame < wanted)
        {
            ++*frame;
            in_time->next_frame({}, *frame == wanted);
            if (in_time->carried)
                *is_converged &= in_time->carried->session().frames().back().solve.stop ==
                                 Stop::Converged;
        }
        std::vector<Geometry> seen = {in_time->simulation.stage(kAround)};
        if (in_time->carried)
        {
            const Session& session = in_time->carried->session();
            Geometry& model = seen.emplace_back(session.geometry());
            model.samples = session.deformed().samples;
            for (Eigen::Vector3d& x : model.samples)
                x *= in_time->scene.unit;
        }
        return seen;
    };
    const auto warnings = [=]
    {
        std::vector<std::string> all = in_time->warnings;
        if (in_time->carried)
        {
            const std::vector<std::string>& more = in_time->carried->session().warnings();
            all.insert(all.end(), more.begin(), more.end());
        }
        return all;
    };
    return Film{in_time->simulation.last_frame(), draw,
                [=]
                { return *is_converged && in_time->simulation.report().is_converged; },
                warnings};
}

Json rods_of_scene(const std::string& scene)
{
    Json rods = Json::array();
    if (has_simulation(scene))
        for (const RodStatement& rod : read_rod_scene(scene).rods)
            rods.push_back({{"name", rod.name},
                            {"points", std::max(rod.points.size(), rod.through.size())},
                            {"closed", rod.is_closed},
                            {"carries", rod.carries}});
    return rods;
}

void add_simulate(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<SimulateFlags>();
    CLI::App* const command = app.add_subcommand(
        "simulate",
        "Spline rods in time, and the model whose cells they carry: a scene in, frames "
        "out.\n\n"
        "  cellwarp simulate samples/rods/cantilever.json -o bent.obj\n"
        "  cellwarp simulate samples/rods/pendulum.json -o 'swing-{frame:03}.obj'\n"
        "  cellwarp simulate samples/rods/tentacle.json -o 'tentacle-{frame:03}.obj'\n");
    command->add_option("SCENE", flags->scene, "scene with rods and simulate (json)")
        ->required();
    command->add_option(
        "-o,--output", flags->output,
        "rods as tubes (.obj, .ply), or the model that they carry, in its format: the "
        "last frame; {frame} or {frame:04}: one a frame; -: stdout, rods as OBJ");
    command->add_option(
        "--rods", flags->rods,
        "rods beside the model that they carry, in its unit (.obj, .ply)");
    command->add_flag("--lines", flags->writes_lines,
                      "rods as lines along their middle, not as tubes");
    command->add_option("--around", flags->around, "corners around a tube (default 12)")
        ->check(CLI::Range(3, 1000));
    command->callback([=, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp
