// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp simulate: rods in time, frames out.
#include "editor/cli/simulate.h"

#include <cmath>

#include <fmt/format.h>

#include "editor/cli/output_name.h"
#include "editor/session/peak_memory.h"
#include "editor/simulation/simulation.h"
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
    std::string scene, output;
    bool writes_lines = false;
    std::int64_t around = 12;
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
std::string lines_of(const Simulation& simulation)
{
    std::string text = "# cellwarp simulate\n";
    std::size_t first = 1;
    for (const SimulatedRod& rod : simulation.rods(kPlaces))
    {
        text += "o " + rod.name + "\n";
        for (const Eigen::Vector3d& p : rod.curve)
            text += fmt::format("v {} {} {}\n", p.x(), p.y(), p.z());
        text += "l";
        for (std::size_t k = 0; k < rod.curve.size(); ++k)
            text += fmt::format(" {}", first + k);
        text += "\n";
        first += rod.curve.size();
    }
    return text;
}

std::string bytes_of(const Simulation& simulation, const SimulateFlags& flags)
{
    if (flags.writes_lines)
        return lines_of(simulation);
    const Geometry surface = simulation.surface(static_cast<int>(flags.around));
    const std::string extension = extension_of(flags.output);
    return plain_mesh_bytes(surface, {surface.samples, {}},
                            extension.empty() ? "obj" : extension);
}

int run(const SimulateFlags& flags, const CommonFlags& common)
{
    const Clock::time_point start = Clock::now();
    if (flags.output.empty() && !common.is_json)
        throw Error(Fault::Usage, "simulate needs -o, or --json");
    if (flags.output == "-" && common.is_json)
        throw Error(Fault::Usage, "-o - and --json both need stdout");
    const OutputName name(flags.output);
    if (!flags.output.empty() && flags.output != "-" &&
        !(flags.writes_lines ? extension_of(flags.output) == "obj"
                             : is_plain_format(extension_of(flags.output))))
        throw Error(Fault::Usage,
                    "-o: got " + in_quotes(flags.output) +
                        (flags.writes_lines ? ", lines are written as .obj"
                                            : ", rods are written as .obj or .ply"));
    const RodScene scene = read_rod_scene(flags.scene);
    Simulation simulation(scene);
    const std::int64_t steps = simulation.num_steps();
    if (!flags.output.empty() && !name.has_frame())
        check_output(flags.output, common.overwrite());
    for (std::int64_t frame = simulation.is_static() ? 1 : 0;
         name.has_frame() && frame <= simulation.last_frame(); ++frame)
        check_output(name.of(simulation.is_static() ? frame - 1 : frame),
                     common.overwrite());
    const double load_ms = ms_since(start);

    Progress progress(common);
    std::vector<std::string> warnings = scene.warnings;
    warnings.insert(warnings.end(), simulation.warnings().begin(),
                    simulation.warnings().end());
    Json frames = Json::array();
    double write_ms = 0.0;
    bool is_converged = true;
    std::int64_t num_stopped = 0;
    const Clock::time_point begin = Clock::now();
    const auto end_frame = [&](std::int64_t frame, bool is_last)
    {
        const SimulationReport report = simulation.report();
        if (!report.is_converged)
        {
            is_converged = false;
            std::string what =
                fmt::format("frame {}, {}: {}", frame, report.stopped, report.stop);
            if (report.violation > 1e-9)
                what +=
                    fmt::format("; constraints are violated by up to {:.3g} (m, or rad)",
                                report.violation);
            if (++num_stopped <= kMostTold)
                warnings.push_back(std::move(what));
        }
        if (common.is_json)
            frames.push_back(frame_json(frame, report, simulation));
        if (flags.output.empty() || !(name.has_frame() || is_last))
            return;
        const Clock::time_point write_start = Clock::now();
        write_file(name.of(frame), bytes_of(simulation, flags), common.overwrite());
        write_ms += ms_since(write_start);
    };
    std::int64_t frame = 0;
    if (!simulation.is_static())
        end_frame(frame++, steps == 0);
    const auto show = [&]
    {
        const std::int64_t done = simulation.steps_done();
        progress.show(static_cast<double>(done) / static_cast<double>(steps),
                      fmt::format("step {} of {}", done, steps));
    };
    while (simulation.steps_done() < steps)
    {
        simulation.next_frame(show);
        end_frame(frame++, simulation.steps_done() == steps);
    }
    progress.end();
    if (num_stopped > kMostTold)
        warnings.push_back(fmt::format("and {} frames more", num_stopped - kMostTold));
    const double simulate_ms = ms_since(begin) - write_ms;
    print_warnings(warnings, common);
    if (common.is_json)
    {
        Json json;
        json["frames"] = std::move(frames);
        json["steps"] = simulation.steps_done();
        json["ms"] = {{"load", load_ms},
                      {"simulate", simulate_ms},
                      {"write", write_ms},
                      {"total", ms_since(start)}};
        json["peak_rss_mb"] = peak_memory_mb();
        json["unused"] = {"interior", "refinement", "blend",   "rbf",  "rbf-global",
                          "skeleton", "picking",    "normals", "faces"};
        json["warnings"] = warnings;
        write_file("-", json.dump(2) + "\n", Overwrite::Yes);
    }
    return is_converged ? 0 : kNotConverged;
}

} // namespace

std::optional<Film> film_of_rods(const std::string& scene)
{
    if (!has_simulation(scene))
        return std::nullopt;
    const RodScene read = read_rod_scene(scene);
    const auto simulation = std::make_shared<Simulation>(read);
    std::vector<std::string> warnings = read.warnings;
    warnings.insert(warnings.end(), simulation->warnings().begin(),
                    simulation->warnings().end());
    const auto frame = std::make_shared<std::int64_t>(0);
    const auto draw = [=](std::int64_t wanted)
    {
        constexpr int kAround = 24;
        for (; *frame < wanted; ++*frame)
            simulation->next_frame();
        return simulation->stage(kAround);
    };
    return Film{simulation->last_frame(), draw,
                [=] { return simulation->report().is_converged; }, warnings};
}

void add_simulate(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<SimulateFlags>();
    CLI::App* const command = app.add_subcommand(
        "simulate",
        "Spline rods in time: a scene in, frames out.\n\n"
        "  cellwarp simulate samples/rods/cantilever.json -o bent.obj\n"
        "  cellwarp simulate samples/rods/pendulum.json -o 'swing-{frame:03}.obj'\n");
    command->add_option("SCENE", flags->scene, "scene with rods and simulate (json)")
        ->required();
    command->add_option(
        "-o,--output", flags->output,
        "rods as tubes (.obj, .ply): the last frame; {frame} or {frame:04}: one "
        "a frame; -: stdout, as OBJ");
    command->add_flag("--lines", flags->writes_lines,
                      "rods as lines along their middle, not as tubes");
    command->add_option("--around", flags->around, "corners around a tube (default 12)")
        ->check(CLI::Range(3, 1000));
    command->callback([=, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp
