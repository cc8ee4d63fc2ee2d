// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp check: reads and validates all that a scene names, solves nothing.
#include <algorithm>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "editor/cli/command.h"
#include "editor/cli/rods_json.h"
#include "editor/cli/session_flags.h"
#include "editor/cli/simulation_json.h"
#include "io/formats/face_triangles.h"
#include "io/formats/geometry_file.h"
#include "io/scene/scene_file.h"
#include "library/session/body.h"
#include "library/session/json.h"
#include "library/session/session_json.h"
#include "octree/self_intersections.h"

namespace cellwarp::core
{

namespace
{

/// A scene of nothing but rods in time: what simulate would begin with.
int check_objects(const SessionFlags& flags, const SceneFile& scene,
                  const std::vector<std::string>& warnings, const CommonFlags& common)
{
    if (!flags.handles.empty() || !flags.sel.empty() || !flags.def.empty() ||
        flags.script.is_given())
        throw Error(Fault::Usage,
                    at({flags.model, 0, ""}, "is a scene of rods in time: handles and "
                                             "moves are for edits"));
    print_warnings(warnings, common);
    const std::string text =
        common.is_json
            ? json_text({{"model", scene.model.empty() ? Json() : Json(scene.model)},
                         {"frames", scene.time.last_frame() + 1},
                         {"steps", scene.time.num_steps()},
                         {"rods_in_time", rods_in_time_json(scene)},
                         {"warnings", warnings}})
            : fmt::format("{}: {}: in order\n", flags.model, objects_text(scene));
    write_file("-", text, Overwrite::Yes);
    return 0;
}

/// Regions are found in the cells, which a session makes for a frame: a script that has
/// regions or joints alone gets one at rest.
void add_rest_frame(HandleFile& handles)
{
    if (handles.stages.empty())
        return;
    Stage& first = handles.stages.front();
    if (first.frames.empty() && !(first.regions.empty() && first.joints.empty()))
        first.frames.push_back({.number = 0, .moves = {}, .is_asked = false});
}

/// Checks the samples, groups and label files that regions after a commit name. Where the
/// samples are then is not known without solving, so their shapes are not checked.
void check_later_stages(const HandleFile& handles, const Geometry& geometry)
{
    for (std::size_t k = 1; k < handles.stages.size(); ++k)
        check_lists(handles.stages[k].regions, geometry, handles);
}

int run(const SessionFlags& flags, const CommonFlags& common)
{
    const SceneFile scene = scene_or_model(flags.model);
    if (!scene.unknown_keys.empty())
        throw Error(Fault::Malformed,
                    fmt::format("{}", fmt::join(scene.unknown_keys, "\n")));
    const bool has_objects = scene.has_moving_objects();
    if (has_objects && !scene.has_flesh())
    {
        const std::vector<std::string> warnings =
            Simulation(read_simulation(scene)).warnings();
        if (scene.model.empty() || scene.time.carries())
            return check_objects(flags, scene, warnings, common);
    }
    SessionRequest request =
        read_request(flags, scene.has_flesh() ? ForTime::Yes : ForTime::No, scene);
    const auto geometry = std::make_shared<const Geometry>(
        read_geometry(request.scene.model, request.read).geometry);
    if (!request.handles)
        request.handles.emplace();
    const std::optional<FleshFacts> flesh =
        facts_of_flesh(scene, *request.handles, *geometry, request.settings.cells);
    std::size_t num_frames = 0;
    for (const Stage& stage : request.handles->stages)
        num_frames += stage.frames.size();
    add_rest_frame(*request.handles);
    check_later_stages(*request.handles, *geometry);
    const Session session(geometry, std::move(*request.handles), request.settings);
    std::vector<std::string> warnings = request.warnings;
    warnings.insert(warnings.end(), session.warnings().begin(), session.warnings().end());
    if (flesh)
        for (const std::string& warning : flesh->warnings)
            if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end())
                warnings.push_back(warning);
    print_warnings(warnings, common);
    const CellSystem* const system = session.system();
    const std::size_t cells = system ? system->body().cells.size() : 0;
    const std::size_t regions = system ? system->regions().size() : 0;
    const std::size_t samples = session.geometry().samples.size();
    const std::vector<Eigen::Vector3d>& rest = geometry->samples;
    const std::vector<Triangle> triangles = triangles_of(*geometry);
    std::optional<SelfIntersections> intersections;
    if (!triangles.empty())
        intersections = IntersectionCounter(triangles, rest).count(rest);
    std::optional<Parts> parts;
    if (system && !triangles.empty() && system->rest().parts.count() > 0)
        parts = system->rest().parts;
    std::string text;
    if (common.is_json)
        text = json_text(
            {{"model", request.scene.model},
             {"samples", samples},
             {"cells", cells},
             {"regions", regions},
             {"frames", num_frames},
             {"self_intersections",
              intersections ? Json{{"rest", intersections->all}} : Json()},
             {"parts", parts_json(parts)},
             {"rods", rods_json(session.rods())},
             {"rods_in_time", has_objects ? rods_in_time_json(scene) : Json::array()},
             {"skeleton", skeleton_json(session)},
             {"flesh", flesh ? flesh->json : Json()},
             {"warnings", warnings}});
    else
        text = fmt::format("{}: {} samples, {} cells, {} regions, {} frames: in order\n",
                           flags.model, samples, cells, regions, num_frames) +
               (intersections && intersections->all > 0
                    ? fmt::format("{} pairs of triangles intersect at rest\n",
                                  intersections->all)
                    : "") +
               parts_text(parts) + rods_text(session.rods()) +
               (has_objects ? "in time: " + objects_text(scene) + "\n" : "") +
               skeleton_text(session) + (flesh ? flesh->text : "");
    write_file("-", text, Overwrite::Yes);
    return 0;
}

} // namespace

void add_check(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<SessionFlags>();
    CLI::App* command = app.add_subcommand(
        "check", "Reads and validates everything a scene names, unknown keys among it; "
                 "solves nothing.\n\n"
                 "  cellwarp check samples/bar.json\n"
                 "  cellwarp check scan.ply --handles bend.handles\n");
    flags->add_to(*command);
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp::core
