// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "io/formats/geometry_file.h"
#include "io/scene/time_settings.h"
#include "library/session/played_frames.h"
#include "library/session/session_json.h"
#include "library/session/session_request.h"
#include "library/session/volume.h"
#include "library/time/flesh_simulation.h"
#include "library/time/in_time.h"
#include "library/time/told_in_time.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

Json components(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
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

} // namespace

Json told_of_flesh(std::int64_t number, const FleshFrame& frame,
                   const FleshSimulation& simulation,
                   const std::vector<Eigen::Vector3d>& samples)
{
    const FleshBody& body = simulation.body();
    const std::optional<Volume> volume = enclosed_volumes(simulation.geometry(), samples);
    Json json = {
        {"frame", number},
        {"time", frame.time},
        {"energy",
         {{"kinetic", frame.kinetic},
          {"elastic", frame.elastic},
          {"gravity", frame.gravity}}},
        {"momentum", components(frame.momentum)},
        {"angular_momentum", components(frame.angular_momentum)},
        {"constraint", frame.miss},
        {"iterations", frame.systems},
        {"stop", frame.stop},
        {"rods", Json::array()},
        {"skeleton",
         {{"elastic", frame.elastic},
          {"kinetic", frame.kinetic},
          {"largest_strain", frame.largest_strain},
          {"inverted", frame.inverted},
          {"cg_steps", frame.cg_steps},
          {"contacts", frame.contacts},
          {"support", components(frame.support)},
          {"pull", components(frame.pull)},
          {"step_ms", frame.step_ms}}},
        {"volume",
         volume ? Json{{"before", volume->before}, {"after", volume->after}} : Json()}};
    json["skeleton"].update(size_of(body));
    if (body.model->flesh().law == "regions")
        json["skeleton"]["factors"] = frame.factors;
    if (body.model->flesh().detail > 0.0)
        json["skeleton"].update({{"split", frame.split},
                                 {"merged", frame.merged},
                                 {"detail_ms", frame.detail_ms}});
    return json;
}

FleshRequest read_flesh_request(const SceneFile& scene)
{
    SessionRequest request = request_of(scene, ForTime::Yes);
    FleshRequest out;
    out.scene = std::move(request.scene);
    if (request.handles)
        out.handles = std::move(*request.handles);
    out.file = std::make_shared<const GeometryFile>(
        read_geometry(out.scene.model, request.read));
    out.cells = request.settings.cells;
    out.warnings = std::move(request.warnings);
    return out;
}

void SeenFlesh::add(const FleshFrame& frame)
{
    limited += frame.limited;
    inverted = std::max(inverted, frame.inverted);
}

void SeenFlesh::add_warnings(const FleshSimulation& simulation,
                             std::vector<std::string>& out) const
{
    if (limited > 0)
        out.push_back(
            fmt::format("{} turns of joints were cut to their limits", limited));
    if (inverted > 0)
        out.push_back(fmt::format(
            "up to {} of {} cells were turned inside out: shorter steps, stiffer flesh, "
            "or another law may bear it",
            inverted, simulation.body().flesh->lattice().cells.size()));
}

PartCounts parts_of_flesh(const FleshSimulation& simulation)
{
    PartCounts parts;
    parts.skeleton = 1;
    const FleshBody& body = simulation.body();
    parts.interior =
        body.octree && body.octree->rest->material.method != InsideMethod::None;
    parts.faces = simulation.geometry().num_faces() > 0;
    parts.normals = !simulation.geometry().directions.empty();
    return parts;
}

FilmFrame seen_of_flesh(const FleshSimulation& simulation,
                        const std::vector<Eigen::Vector3d>& samples)
{
    FilmFrame seen;
    Geometry& model = seen.parts.emplace_back(simulation.geometry());
    model.samples = samples;
    if (Geometry obstacles = simulation.obstacles(); !obstacles.samples.empty())
        seen.parts.push_back(std::move(obstacles));
    seen.joints = simulation.joints();
    seen.cells = simulation.drawn_cells();
    return seen;
}

namespace
{

class FleshInTime final : public InTime
{
public:
    FleshInTime(const SceneFile& scene, const InTimeOptions& options)
        : request_(read_flesh_request(scene)),
          simulation_(geometry_of(request_.file), request_.scene, request_.cells,
                      options.is_tight, request_.handles),
          deformed_(simulation_.deformed())
    {
    }

    std::vector<std::string> warnings() const override
    {
        std::vector<std::string> all = request_.warnings;
        for (const std::string& warning : simulation_.warnings())
            if (std::find(all.begin(), all.end(), warning) == all.end())
                all.push_back(warning); // both have read the skeleton's file
        seen_.add_warnings(simulation_, all);
        return all;
    }
    bool is_static() const override { return false; }
    std::int64_t last_frame() const override { return simulation_.last_frame(); }
    double time_of(std::int64_t frame) const override
    {
        return simulation_.time_of(frame);
    }
    std::int64_t num_steps() const override { return simulation_.num_steps(); }
    std::int64_t steps_done() const override { return simulation_.steps_done(); }
    void next_frame(const std::function<void()>& watch, bool wants_samples) override
    {
        simulation_.next_frame(watch);
        is_drawn_ = wants_samples;
        if (wants_samples)
            deformed_ = simulation_.deformed();
    }

    Told tell(std::int64_t number, bool wants_json) override
    {
        Told told;
        const FleshFrame frame = simulation_.report();
        seen_.add(frame);
        if (!frame.is_converged)
            told.problems.push_back("the flesh: " + frame.stop);
        if (!wants_json)
            return told;
        if (!std::exchange(is_drawn_, true))
            deformed_ = simulation_.deformed();
        told.json = told_of_flesh(number, frame, simulation_, deformed_.samples);
        return told;
    }
    void add_to(Json& json) const override
    {
        json["mass"] = simulation_.body().mass;
        json["unused"] = unused_parts(parts_of_flesh(simulation_));
    }

    std::shared_ptr<const GeometryFile> model() const override { return request_.file; }
    const DeformedSamples& deformed() const override { return deformed_; }
    std::optional<std::string> bytes_of_rods(const std::string&, double,
                                             const Drawing&) const override
    {
        return std::nullopt;
    }
    double unit() const override { return simulation_.time().unit; }

    FilmFrame seen(int) const override
    {
        return seen_of_flesh(simulation_, deformed_.samples);
    }

private:
    FleshRequest request_;
    FleshSimulation simulation_;
    DeformedSamples deformed_;
    bool is_drawn_ = true; ///< deformed_ is of now
    SeenFlesh seen_;
};

} // namespace

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

std::unique_ptr<InTime> open_flesh_in_time(const SceneFile& scene,
                                           const InTimeOptions& options)
{
    return std::make_unique<FleshInTime>(scene, options);
}

} // namespace cellwarp::core
