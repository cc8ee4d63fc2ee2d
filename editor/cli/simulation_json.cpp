// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/simulation_json.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "library/session/played_frames.h"
#include "library/session/session_json.h"
#include "library/session/volume.h"

namespace cellwarp::core
{

namespace
{

constexpr int kSheetPlaces = 5; ///< along each side of a sheet

Json numbers(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
}

/// Curves of rods, and their section forces if the scene asks for them.
Json rods_json(const ObjectSimulation& simulation)
{
    Json rods = Json::array();
    for (const SimulatedRod& rod : simulation.rods(kPlacesOfCurve))
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
    if (simulation.reports_sections())
    {
        const std::vector<SimulatedSections> sections =
            simulation.sections(kPlacesOfCurve);
        for (std::size_t r = 0; r < sections.size(); ++r)
        {
            Json shear = Json::array(), moment = Json::array(), frames = Json::array();
            for (std::size_t k = 0; k < sections[r].shear.size(); ++k)
            {
                shear.push_back(numbers(sections[r].shear[k]));
                moment.push_back(numbers(sections[r].moment[k]));
                Json axes = Json::array();
                for (const Eigen::Index c : {0, 1, 2})
                    axes.push_back(numbers(sections[r].frame[k].col(c)));
                frames.push_back(std::move(axes));
            }
            rods[r]["sections"] = {{"tension", sections[r].tension},
                                   {"torque", sections[r].torque},
                                   {"shear", std::move(shear)},
                                   {"moment", std::move(moment)},
                                   {"frame", std::move(frames)}};
        }
    }
    return rods;
}

Json bodies_json(const ObjectSimulation& simulation)
{
    Json bodies = Json::array();
    for (const SimulatedBody& body : simulation.bodies())
    {
        Json axes = Json::array();
        for (Eigen::Index k = 0; k < 3; ++k)
            axes.push_back(numbers(body.R.col(k)));
        bodies.push_back(
            {{"name", body.name}, {"at", numbers(body.at)}, {"axes", std::move(axes)}});
    }
    return bodies;
}

Json nets_json(const ObjectSimulation& simulation)
{
    Json nets = Json::array();
    for (const SimulatedNet& net : simulation.nets())
    {
        Json points = Json::array();
        for (const Eigen::Vector3d& p : net.points)
            points.push_back(numbers(p));
        nets.push_back({{"name", net.name}, {"points", std::move(points)}});
    }
    return nets;
}

Json sheets_json(const ObjectSimulation& simulation)
{
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
    return sheets;
}

/// Forces of holds, joints and contacts.
Json forces_json(const ObjectSimulation& simulation)
{
    Json forces = Json::array();
    for (const SimulatedForce& force : simulation.forces())
    {
        Json one = {{"at", numbers(force.at)}, {"force", numbers(force.force)}};
        if (force.key.empty())
        {
            one["contact"] = {{"rod", force.rod}, {"share", force.share}};
            if (!force.other.empty())
                one["other"] = {{"rod", force.other}, {"share", force.other_share}};
        }
        else
        {
            one["key"] = force.key;
            one["couple"] = numbers(force.couple);
        }
        forces.push_back(std::move(one));
    }
    return forces;
}

/// Counts of the lattice and of what holds it.
Json size_of(const FleshBody& body)
{
    return {{"nodes", body.flesh->lattice().places.size()},
            {"free_nodes", body.flesh->nodes().free.size()},
            {"cells", body.flesh->lattice().cells.size()},
            {"E", body.model->materials[0].young},
            {"held_points", body.held},
            {"rows_dropped", body.dropped}};
}

Json flesh_json(const FleshMeasures& measures, const FleshBody& body)
{
    Json json = {{"elastic", measures.elastic},
                 {"kinetic", measures.kinetic},
                 {"largest_strain", measures.largest_strain},
                 {"inverted", measures.inverted},
                 {"cg_steps", measures.cg_steps},
                 {"contacts", measures.contacts},
                 {"support", numbers(measures.support)},
                 {"pull", numbers(measures.pull)},
                 {"step_ms", measures.step_ms}};
    json.update(size_of(body));
    if (body.model->flesh().law == "regions")
        json["factors"] = measures.factors;
    if (body.model->flesh().detail > 0.0)
        json.update({{"split", measures.split},
                     {"merged", measures.merged},
                     {"detail_ms", measures.detail_ms}});
    return json;
}

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

PartCounts parts_of(const Simulation& simulation)
{
    if (simulation.carried())
        return simulation.carried()->parts();
    PartCounts parts;
    const FleshSimulation* const flesh = simulation.flesh();
    if (!flesh)
        return parts;
    const FleshBody& body = flesh->body();
    parts.skeleton = 1;
    parts.rods = simulation.objects() ? 1 : 0;
    parts.interior =
        body.octree && body.octree->rest->material.method != InsideMethod::None;
    parts.faces = flesh->geometry().num_faces() > 0;
    parts.normals = !flesh->geometry().directions.empty();
    return parts;
}

} // namespace

Json moment_json(std::int64_t frame, const SimulationReport& report,
                 Simulation& simulation)
{
    Json json = {{"frame", frame},
                 {"time", report.time},
                 {"energy",
                  {{"kinetic", report.kinetic},
                   {"elastic", report.elastic},
                   {"gravity", report.gravity}}},
                 {"momentum", numbers(report.momentum)},
                 {"angular_momentum", numbers(report.angular_momentum)},
                 {"constraint", report.violation},
                 {"iterations", report.iterations},
                 {"stop", report.stop},
                 {"rods", Json::array()}};
    if (const ObjectSimulation* const objects = simulation.objects())
    {
        json["rods"] = rods_json(*objects);
        json["bodies"] = bodies_json(*objects);
        json["nets"] = nets_json(*objects);
        if (Json sheets = sheets_json(*objects); !sheets.empty())
            json["sheets"] = std::move(sheets);
        if (objects->reports_forces())
            json["forces"] = forces_json(*objects);
    }
    if (report.at_once > 0)
        json["at_once"] = report.at_once;
    if (report.has_contacts)
    {
        json["energy"]["contact"] = report.touching;
        json["contact"] = {{"count", report.contacts},
                           {"nearest", report.nearest ? Json(*report.nearest) : Json()}};
    }
    if (report.cells)
        json["model"] = frame_json(*report.cells);
    if (report.flesh)
    {
        json["skeleton"] = flesh_json(*report.flesh, simulation.flesh()->body());
        const std::optional<Volume> volume = enclosed_volumes(
            simulation.flesh()->geometry(), simulation.deformed().samples);
        json["volume"] =
            volume ? Json{{"before", volume->before}, {"after", volume->after}} : Json();
    }
    return json;
}

void add_summary(const Simulation& simulation, Json& json)
{
    if (simulation.flesh())
        json["mass"] = simulation.flesh()->body().mass;
    if (simulation.carried())
        json["carriers"] = carriers_json(*simulation.carried());
    json["unused"] = unused_parts(parts_of(simulation));
}

Json rods_in_time_json(const SceneFile& scene)
{
    Json rods = Json::array();
    for (const RodStatement& rod : scene.time.rods)
        rods.push_back({{"name", rod.name},
                        {"points", rod.line.points.size()},
                        {"closed", rod.line.is_closed},
                        {"carries", rod.carries}});
    return rods;
}

Json objects_json(const SceneFile& scene)
{
    if (!scene.has_moving_objects())
        return nullptr;
    const RodScene& time = scene.time;
    Json json = {{"rods", rods_in_time_json(scene)},
                 {"sheets", Json::array()},
                 {"nets", Json::array()},
                 {"bodies", Json::array()},
                 {"joints", time.joints.size()},
                 {"obstacles", time.obstacles.size()},
                 {"frames", time.last_frame() + 1},
                 {"seconds", time.is_static() ? Json(nullptr) : Json(time.duration)}};
    for (const SheetStatement& sheet : time.sheets)
        json["sheets"].push_back({{"name", sheet.name}, {"counts", sheet.counts}});
    for (const NetStatement& net : time.nets)
        json["nets"].push_back({{"name", net.name},
                                {"points", net.points.size()},
                                {"springs", net.springs.size()}});
    for (const BodyStatement& body : time.bodies)
        json["bodies"].push_back({{"name", body.name}, {"mass", body.mass}});
    return json;
}

std::string objects_text(const SceneFile& scene)
{
    const RodScene& time = scene.time;
    std::string text;
    const auto add = [&](std::size_t count, const char* what)
    {
        if (count > 0)
            text += fmt::format("{} {}{}, ", count, what, count == 1 ? "" : "s");
    };
    add(time.rods.size(), "rod");
    add(time.sheets.size(), "sheet");
    add(time.nets.size(), "net");
    add(time.joints.size(), "joint");
    return text + (time.is_static()
                       ? "an equilibrium"
                       : fmt::format("{} frames, {} steps", time.last_frame() + 1,
                                     time.num_steps()));
}

std::optional<FleshFacts> facts_of_flesh(const SceneFile& scene,
                                         const HandleFile& handles,
                                         const Geometry& geometry,
                                         const CellSettings& cells)
{
    if (!scene.has_flesh())
        return std::nullopt;
    const SkeletonValues skeleton = played_skeleton(scene, handles, geometry);
    const std::shared_ptr<const FleshModel> model =
        flesh_model(std::shared_ptr<const Geometry>(std::shared_ptr<void>(), &geometry),
                    scene, skeleton, cells, false);
    const FleshBody body = build_flesh(model);
    FleshFacts facts;
    facts.json = size_of(body);
    facts.json["mass"] = body.mass;
    facts.text = fmt::format("  flesh: {} cells, {} nodes, {} of them free, {} points on "
                             "bones, {:.4g} kg\n",
                             body.flesh->lattice().cells.size(),
                             body.flesh->lattice().places.size(),
                             body.flesh->nodes().free.size(), body.held, body.mass);
    facts.warnings = skeleton.warnings;
    facts.warnings.insert(facts.warnings.end(), model->warnings.begin(),
                          model->warnings.end());
    facts.warnings.insert(facts.warnings.end(), body.warnings.begin(),
                          body.warnings.end());
    return facts;
}

} // namespace cellwarp::core
