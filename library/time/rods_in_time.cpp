// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/base/text.h"
#include "io/formats/geometry_file.h"
#include "io/formats/plain_mesh.h"
#include "io/scene/scene_file.h"
#include "io/scene/time_settings.h"
#include "library/session/session_json.h"
#include "library/session/session_request.h"
#include "library/time/carried_model.h"
#include "library/time/in_time.h"
#include "library/time/simulation.h"
#include "library/time/told_in_time.h"

namespace cellwarp::core
{

namespace
{

constexpr int kPlacesOfCurve = 33; ///< of each curve in --json
constexpr int kSheetPlaces = 5;    ///< along each side of a sheet

Json numbers(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
}

} // namespace

Json told_of_rods(std::int64_t frame, const SimulationReport& report,
                  const Simulation& simulation)
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
    if (simulation.reports_forces())
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
        out["forces"] = std::move(forces);
    }
    if (report.at_once > 0)
        out["at_once"] = report.at_once;
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

std::string problem_of_rods(const SimulationReport& report)
{
    std::string what = report.stopped + ": " + report.stop;
    if (report.violation > 1e-9)
        what += fmt::format("; constraints are violated by up to {:.3g} (m, or rad)",
                            report.violation);
    if (report.at_once > 0)
        what += fmt::format("; {} steps were not cut in parts, since those before them "
                            "failed in all of theirs",
                            report.at_once);
    return what;
}

namespace
{

/// The rods' middles as an OBJ of lines.
std::string lines_of(const Simulation& simulation, double unit)
{
    std::string text = "# cellwarp simulate\n";
    std::size_t first = 1;
    for (const SimulatedRod& rod : simulation.rods(kPlacesOfCurve))
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

} // namespace

std::string bytes_of(const Simulation& rods, const std::string& name, double unit,
                     const InTime::Drawing& drawing)
{
    if (drawing.writes_lines)
        return lines_of(rods, unit);
    Geometry surface = rods.surface(drawing.around);
    for (Eigen::Vector3d& x : surface.samples)
        x /= unit;
    const std::string extension = extension_of(name);
    return plain_mesh_bytes(surface, {surface.samples, {}},
                            extension.empty() ? "obj" : extension);
}

namespace
{

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

class RodsInTime final : public InTime
{
public:
    RodsInTime(const SceneFile& scene, const InTimeOptions& options)
        : time_(scene.time), simulation_(scene.time), warnings_(scene.warnings)
    {
        if (!scene.time.carries() && !scene.model.empty())
            warnings_.push_back(
                at({scene.path, 0, "model"}, "no rod carries it, it is left out"));
        if (scene.time.carries())
            read_model(scene, options);
        warnings_.insert(warnings_.end(), simulation_.warnings().begin(),
                         simulation_.warnings().end());
    }

    std::vector<std::string> warnings() const override
    {
        std::vector<std::string> all = warnings_;
        if (carried_)
            all.insert(all.end(), carried_->session().warnings().begin(),
                       carried_->session().warnings().end());
        return all;
    }
    bool is_static() const override { return simulation_.is_static(); }
    std::int64_t last_frame() const override
    {
        return is_static() ? 0 : simulation_.last_frame();
    }
    double time_of(std::int64_t frame) const override { return time_.time_of(frame); }
    std::int64_t num_steps() const override { return simulation_.num_steps(); }
    std::int64_t steps_done() const override { return simulation_.steps_done(); }
    void next_frame(const std::function<void()>& watch, bool wants_samples) override
    {
        simulation_.next_frame(watch);
        if (carried_)
            carried_->follow(simulation_, wants_samples);
    }

    Told tell(std::int64_t frame, bool wants_json) override
    {
        Told told;
        const SimulationReport report = simulation_.report();
        const FrameReport* const cells = carried_ && !carried_->session().frames().empty()
                                             ? &carried_->session().frames().back()
                                             : nullptr;
        if (!report.is_converged)
            told.problems.push_back(problem_of_rods(report));
        if (cells && cells->solve.stop != Stop::Converged)
            told.problems.push_back(
                fmt::format("the cells did not converge ({}, gradient {:.3g})",
                            stop_name(cells->solve.stop), cells->solve.gradient));
        if (!wants_json)
            return told;
        told.json = told_of_rods(frame, report, simulation_);
        if (cells)
            told.json["model"] = frame_json(*cells);
        return told;
    }
    void add_to(Json& json) const override
    {
        if (carried_)
            json["carriers"] = carriers_json(carried_->session());
        json["unused"] =
            unused_parts(carried_ ? carried_->session().parts() : PartCounts{});
    }

    std::shared_ptr<const GeometryFile> model() const override { return model_; }
    const DeformedSamples& deformed() const override
    {
        return carried_->session().deformed();
    }
    std::optional<std::string> bytes_of_rods(const std::string& name, double unit,
                                             const Drawing& drawing) const override
    {
        return bytes_of(simulation_, name, unit, drawing);
    }
    double unit() const override { return time_.unit; }

    FilmFrame seen(int around) const override
    {
        FilmFrame seen = {{simulation_.stage(around)}, {}, {}};
        if (carried_)
        {
            const Session& session = carried_->session();
            Geometry& model = seen.parts.emplace_back(session.geometry());
            model.samples = session.deformed().samples;
            for (Eigen::Vector3d& x : model.samples)
                x *= time_.unit;
        }
        return seen;
    }

private:
    void read_model(const SceneFile& scene, const InTimeOptions& options)
    {
        SessionRequest request = request_of(scene, ForTime::Yes);
        warnings_ = request.warnings;
        request.settings.watch = options.watch;
        model_ = std::make_shared<const GeometryFile>(
            read_geometry(request.scene.model, request.read));
        carried_.emplace(geometry_of(model_),
                         std::move(request.handles).value_or(HandleFile()),
                         request.settings, time_.unit, simulation_);
    }

    const TimeSettings time_;
    Simulation simulation_;
    std::shared_ptr<const GeometryFile> model_;
    std::optional<CarriedModel> carried_;
    std::vector<std::string> warnings_;
};

Json rods_of(const std::vector<RodStatement>& all)
{
    Json rods = Json::array();
    for (const RodStatement& rod : all)
        rods.push_back({{"name", rod.name},
                        {"points", std::max(rod.points.size(), rod.through.size())},
                        {"closed", rod.is_closed},
                        {"carries", rod.carries}});
    return rods;
}

} // namespace

std::unique_ptr<InTime> open_rods_in_time(const SceneFile& scene,
                                          const InTimeOptions& options)
{
    return std::make_unique<RodsInTime>(scene, options);
}

Json scene_in_time(const SceneFile& of)
{
    const RodScene& scene = of.time;
    if (of.in_time() != TimeScene::Rods && of.in_time() != TimeScene::FleshAndRods)
        return nullptr;
    Json json = {{"rods", rods_of(scene.rods)},
                 {"sheets", Json::array()},
                 {"nets", Json::array()},
                 {"bodies", Json::array()},
                 {"joints", scene.joints.size()},
                 {"obstacles", scene.obstacles.size()},
                 {"frames", scene.last_frame() + 1},
                 {"seconds", scene.is_static() ? Json(nullptr) : Json(scene.duration)}};
    for (const SheetStatement& sheet : scene.sheets)
        json["sheets"].push_back({{"name", sheet.name}, {"counts", sheet.counts}});
    for (const NetStatement& net : scene.nets)
        json["nets"].push_back({{"name", net.name},
                                {"points", net.points.size()},
                                {"springs", net.springs.size()}});
    for (const BodyStatement& body : scene.bodies)
        json["bodies"].push_back({{"name", body.name}, {"mass", body.mass}});
    return json;
}

std::optional<RodFacts> facts_of_rods(const SceneFile& of)
{
    const RodScene& scene = of.time;
    if (of.in_time() != TimeScene::Rods && of.in_time() != TimeScene::FleshAndRods)
        return std::nullopt;
    RodFacts facts;
    facts.rods = rods_of(scene.rods);
    facts.num_frames = scene.last_frame() + 1;
    facts.num_steps = scene.num_steps();
    const auto add = [&](std::size_t count, const char* what)
    {
        if (count > 0)
            facts.text += fmt::format("{} {}{}, ", count, what, count == 1 ? "" : "s");
    };
    add(scene.rods.size(), "rod");
    add(scene.sheets.size(), "sheet");
    add(scene.nets.size(), "net");
    add(scene.joints.size(), "joint");
    facts.text += scene.is_static() ? "an equilibrium"
                                    : fmt::format("{} frames, {} steps", facts.num_frames,
                                                  facts.num_steps);
    if (of.in_time() != TimeScene::Rods)
        return facts;
    facts.are_all = of.model.empty() || scene.carries();
    facts.warnings = open_rods_in_time(of, {})->warnings();
    return facts;
}

} // namespace cellwarp::core
