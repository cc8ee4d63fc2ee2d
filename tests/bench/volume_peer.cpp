// SPDX-License-Identifier: GPL-3.0-or-later
// A result from elsewhere for `cellwarp sweep --against`: a scene's deformation by
// tetrahedra with the energy that cells have in the limit, as rigid as possible, solved
// to its minimum. Scene, regions and the way in steps are the program's own, so that both
// solve the same problem; tetrahedra, energy and solver are not. One JSON object on
// stdout.
#include <algorithm>
#include <cmath>
#include <map>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/formats/face_triangles.h"
#include "io/formats/geometry_file.h"
#include "io/formats/geometry_output.h"
#include "io/scene/handle_file.h"
#include "library/session/body.h"
#include "library/session/handle_trajectory.h"
#include "library/session/region_set.h"
#include "library/session/scene_settings.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "tests/bench/tet_arap.h"
#include "tests/bench/tet_fill.h"
#include "tests/bench/tet_mesh.h"

namespace cellwarp::core::bench
{

namespace
{

using Json = nlohmann::ordered_json;
struct Flags
{
    std::string scene, output;
    double edge = 0.02;
    double border = 0.4;
    double sharp = 80.0;
    int order = 2;
    double tolerance = 1e-6;
};

/// A scene as a session sees it.
struct Problem
{
    GeometryFile model;
    HandleFile handles;
    std::shared_ptr<const RestShape> rest;
    Units units;
    std::unique_ptr<RegionSet> regions;
};

Problem read_problem(const std::string& path)
{
    const SceneFile scene = read_scene(path);
    Problem problem{
        read_geometry(scene.model), read_handles(scene.handles), nullptr, {}, nullptr};
    if (problem.handles.stages.size() != 1)
        throw Error(Fault::Usage, scene.handles + ": has a commit, need one stage");
    const Geometry& geometry = problem.model.geometry;
    problem.rest = build_rest_shape(geometry, geometry.samples, settings_of(scene).cells);
    problem.units = {problem.rest->frame, problem.handles.is_relative,
                     bounding_box(geometry.samples)};
    const Stage& stage = problem.handles.stages.front();
    for (const RegionStatement& region : stage.regions)
        if (region.role != Role::Fixed && region.role != Role::Handle)
            throw malformed({scene.handles, region.line, region.name},
                            "need regions that are fixed or handles");
    problem.regions = std::make_unique<RegionSet>(
        problem.rest,
        resolve_regions(stage.regions, geometry, geometry.samples, problem.units,
                        problem.handles),
        scene.handles);
    for (const Region& region : problem.regions->regions())
        if (!region.listed.empty())
            throw malformed({scene.handles, region.line, region.name},
                            "need a region that is told by its shape");
    return problem;
}

/// The first region that holds a place [work]; -1: none.
int region_at(const Problem& problem, const Eigen::Vector3d& x)
{
    const Eigen::Vector3d place = problem.rest->frame.to_model(x);
    for (std::size_t r = 0; r < problem.regions->size(); ++r)
        if ((*problem.regions)[r].holds(place))
            return static_cast<int>(r);
    return -1;
}

/// The strain has its peaks at the regions' borders, and there the tetrahedra are
/// smaller. Where the borders are inside the shape the points tell that a first mesh is
/// cut at.
TetMesh tets_of(const Problem& problem, const Flags& flags)
{
    constexpr double kGrowth = 0.4; // of the edges with the distance from a border
    const Shape surface{problem.rest->samples, triangles_of(problem.model.geometry)};
    const double edge = flags.edge * problem.rest->frame.diagonal();
    const auto filled_and_cut = [&](const EdgeLength& length)
    {
        return cut_at_regions(fill_with_tets(surface, length, flags.sharp),
                              [&](const Eigen::Vector3d& x)
                              { return region_at(problem, x); });
    };
    const TetMesh mesh = filled_and_cut([&](const Eigen::Vector3d&) { return edge; });
    std::vector<Eigen::Vector3d> border;
    for (std::size_t p = 0; p < mesh.points.size(); ++p)
        if (mesh.region_of_point[p] >= 0)
            border.push_back(mesh.points[p]);
    return filled_and_cut(
        [&](const Eigen::Vector3d& x)
        {
            double squared = INFINITY;
            for (const Eigen::Vector3d& y : border)
                squared = std::min(squared, (x - y).squaredNorm());
            // Between two of these points the border is up to half an edge away.
            const double away = std::max(0.0, std::sqrt(squared) - 0.5 * edge);
            return std::min(edge, flags.border * edge + kGrowth * away);
        });
}

/// The ways of all regions in one frame, and in how many parts a session goes them.
struct Plan
{
    std::vector<HandleTrajectory> paths;
    int parts = 1;
};

/// \p steps: where the regions are; where the frame leaves them afterwards.
Plan plan_of(const Problem& problem, const FrameStatement& frame,
             std::vector<std::vector<Step>>& steps)
{
    std::map<std::string, const Move*> moves;
    for (const Move& move : frame.moves)
        moves[move.region] = &move;
    Plan plan;
    std::vector<std::string> warnings;
    for (std::size_t r = 0; r < problem.regions->size(); ++r)
    {
        const ModelBox& box = problem.regions->box(r);
        std::vector<Step> next = steps[r];
        if (const auto found = moves.find((*problem.regions)[r].name);
            found != moves.end())
            next = steps_of(*found->second, problem.units,
                            {box.centre(), box.centre(), box.low}, problem.handles.path,
                            warnings);
        const HandleTrajectory& path = plan.paths.emplace_back(steps[r], next);
        steps[r] = std::move(next);
        plan.parts = std::max(plan.parts, path.num_parts(box.low, box.high,
                                                         problem.rest->frame.diagonal()));
    }
    return plan;
}

/// Where the tetrahedra are after the last frame.
struct Deformed
{
    Eigen::Matrix3Xd places; ///< of the nodes [work]
    std::vector<Motion> motions;
    TetSolveReport last;
    int newton = 0, cg_steps = 0, parts = 0;
};

Deformed deform(const Problem& problem, const TetElements& elements, double tolerance)
{
    TetSolver solver(elements);
    TetSolveOptions options;
    options.diagonal = problem.rest->frame.diagonal();
    options.tolerance = tolerance;
    Deformed now{elements.rest, std::vector<Motion>(problem.regions->size()), {}};
    std::vector<std::vector<Step>> steps(problem.regions->size());
    for (const FrameStatement& frame : problem.handles.stages.front().frames)
    {
        const Plan plan = plan_of(problem, frame, steps);
        for (int part = 1; part <= plan.parts; ++part)
        {
            for (std::size_t r = 0; r < plan.paths.size(); ++r)
                now.motions[r] = plan.paths[r].at(static_cast<double>(part) / plan.parts);
            for (std::size_t n = 0; n < elements.num_nodes(); ++n)
                if (const int region = elements.region_of_node[n]; region >= 0)
                    now.places.col(static_cast<Eigen::Index>(n)) =
                        now.motions[idx(region)](
                            elements.rest.col(static_cast<Eigen::Index>(n)));
            now.last = solver.solve(now.places, options);
            now.newton += now.last.newton;
            now.cg_steps += now.last.cg_steps;
            ++now.parts;
        }
    }
    return now;
}

/// The samples of the model where the tetrahedra carry them [model unit].
std::vector<Eigen::Vector3d> carried(const Problem& problem, const TetMesh& mesh,
                                     const TetElements& elements, const Deformed& now)
{
    const TetFinder finder(mesh);
    std::vector<Eigen::Vector3d> samples;
    for (const Eigen::Vector3d& x : problem.rest->samples)
    {
        const int region = region_at(problem, x);
        samples.push_back(problem.rest->frame.to_model(
            region >= 0 ? now.motions[idx(region)](x)
                        : elements.place(finder.find(x), now.places)));
    }
    return samples;
}

int run(const Flags& flags)
{
    const Clock::time_point start = Clock::now();
    const Problem problem = read_problem(flags.scene);
    const TetMesh mesh = tets_of(problem, flags);
    const double mesh_seconds = seconds_since(start);
    const Clock::time_point solve_start = Clock::now();
    const TetElements elements(mesh, flags.order);
    const Deformed now = deform(problem, elements, flags.tolerance);
    const double solve_seconds = seconds_since(solve_start);
    const Geometry& geometry = problem.model.geometry;
    DeformedSamples patch{
        carried(problem, mesh, elements, now), {}, geometry.tangents, geometry.rotations};
    for (const DirectionUse& use : direction_uses(geometry))
        patch.directions.push_back(geometry.directions[use.direction]);
    write_geometry(flags.output, problem.model, patch, Overwrite::Yes);
    fmt::print("{}\n", Json({{"scene", flags.scene},
                             {"edge", flags.edge},
                             {"order", flags.order},
                             {"tets", mesh.tets.size()},
                             {"nodes", elements.num_nodes()},
                             {"steps", now.parts},
                             {"newton", now.newton},
                             {"cg_steps", now.cg_steps},
                             {"stop", now.last.stop},
                             {"newton_movement", now.last.newton_movement},
                             {"local_global_movement", now.last.local_global_movement},
                             {"is_saddle", now.last.is_saddle},
                             {"energy", now.last.energy},
                             {"mesh_seconds", mesh_seconds},
                             {"solve_seconds", solve_seconds},
                             {"seconds", seconds_since(start)}})
                           .dump(2));
    return now.last.stop == "converged" ? 0 : 7;
}

} // namespace

} // namespace cellwarp::core::bench

int main(int argc, char** argv)
{
    cellwarp::core::bench::Flags flags;
    CLI::App app("A scene deformed as rigidly as possible by tetrahedra");
    app.add_option("SCENE", flags.scene, "a scene file with handles, one stage")
        ->required();
    app.add_option("-o,--output", flags.output, "the model where it is then")->required();
    app.add_option("--edge", flags.edge, "of the tetrahedra, of the diagonal")
        ->capture_default_str();
    app.add_option("--border", flags.border, "share of that where a region ends")
        ->capture_default_str();
    app.add_option("--sharp", flags.sharp,
                   "edges of the surface with a larger angle stay [degree]")
        ->capture_default_str();
    app.add_option("--order", flags.order, "linear (1) or quadratic (2) tetrahedra")
        ->check(CLI::Range(1, 2))
        ->capture_default_str();
    app.add_option("--tolerance", flags.tolerance,
                   "stop when a Newton step moves no node farther, of the diagonal")
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try
    {
        return cellwarp::core::bench::run(flags);
    }
    catch (const std::exception& error)
    {
        fmt::print(stderr, "error: {}\n", error.what());
        return 1;
    }
}
