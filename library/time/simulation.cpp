// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/simulation.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "io/base/error.h"
#include "library/session/session_request.h"
#include "octree/base/clock.h"

namespace cellwarp::core
{

namespace
{

/// In rows of changing equations, or at one end of a joint: not both.
void refuse_what_joints_cannot_hold(const SceneFile& scene)
{
    const FleshStatement& flesh = scene.skeleton->flesh;
    const auto refuse = [&](const std::string& key, const char* what) {
        throw malformed({scene.path, 0, key}, what);
    };
    if (flesh.law == "regions")
        refuse("skeleton.law", "regions are blended, and so joined to nothing: need "
                               "another law, or no joints");
    if (!flesh.obstacles.empty())
        refuse("skeleton.obstacles", "flesh that is joined to something touches nothing");
    if (flesh.settles.value_or(false))
        refuse("skeleton.settle", "what is joined to the flesh would stay behind");
    if (!flesh.held.empty() && flesh.detail > 0.0)
        refuse("skeleton.held", "points of flesh that is joined to something are held in "
                                "cells that stay: not with detail");
}

/// Whether a joint holds the flesh.
bool has_flesh_end(const RodScene& rods)
{
    return std::any_of(rods.joints.begin(), rods.joints.end(),
                       [](const JointStatement& joint)
                       {
                           return joint.ends[0].kind == JointEnd::Kind::Flesh ||
                                  joint.ends[1].kind == JointEnd::Kind::Flesh;
                       });
}

/// The scene; where it does not say whether the flesh settles, it does not.
SceneFile without_settling(SceneFile scene)
{
    std::optional<bool>& settles = scene.skeleton->flesh.settles;
    settles = settles.value_or(false);
    return scene;
}

void add_new(const std::vector<std::string>& more, std::vector<std::string>& all)
{
    for (const std::string& one : more)
        if (std::find(all.begin(), all.end(), one) == all.end())
            all.push_back(one);
}

} // namespace

SimulationReport together(SimulationReport objects, const SimulationReport& flesh)
{
    objects.kinetic += flesh.kinetic;
    objects.elastic += flesh.elastic;
    objects.gravity += flesh.gravity;
    objects.momentum += flesh.momentum;
    objects.angular_momentum += flesh.angular_momentum;
    objects.iterations += flesh.iterations;
    objects.violation = std::max(objects.violation, flesh.violation);
    if (objects.is_converged)
        objects.stop = flesh.stop;
    objects.is_converged = objects.is_converged && flesh.is_converged;
    objects.problems.insert(objects.problems.begin(), flesh.problems.begin(),
                            flesh.problems.end());
    objects.flesh = flesh.flesh;
    return objects;
}

SimulationInput read_simulation(SceneFile scene,
                                std::shared_ptr<const GeometryFile> model)
{
    if (!scene.is_in_time())
        throw malformed({scene.path, 0, scene.is_simulated ? "rods" : "simulate"},
                        "is missing: there is nothing to simulate");
    SimulationInput input;
    if (!scene.has_flesh() && !scene.time.carries())
    {
        input.warnings = scene.warnings;
        if (!scene.model.empty())
            input.warnings.push_back(
                at({scene.path, 0, "model"}, "no rod carries it, it is left out"));
        input.scene = std::move(scene);
        return input;
    }
    SessionRequest request = request_of(std::move(scene), ForTime::Yes);
    input.model = model ? std::move(model)
                        : std::make_shared<const GeometryFile>(
                              read_geometry(request.scene.model, request.read));
    input.scene = std::move(request.scene);
    input.handles = std::move(request.handles).value_or(HandleFile());
    input.settings = std::move(request.settings);
    input.warnings = std::move(request.warnings);
    return input;
}

Simulation::Simulation(SimulationInput input) : input_(std::move(input))
{
    const SceneFile& scene = input_.scene;
    const bool is_joined = scene.has_flesh() && has_flesh_end(scene.time);
    if (is_joined)
        refuse_what_joints_cannot_hold(scene);
    if (scene.has_flesh())
        flesh_ = std::make_unique<FleshSimulation>(
            geometry_of(input_.model), is_joined ? without_settling(scene) : scene,
            input_.settings.cells, input_.is_tight, input_.handles);
    if (is_joined)
    {
        if (!flesh_->body().held_points.guided.empty())
            throw malformed({scene.path, 0, "skeleton.held"},
                            "flesh that is joined to something is held wholly, at points "
                            "that lie on corners of cells or beside them");
        joined_ = std::make_unique<JoinedFlesh>(*flesh_, scene.path,
                                                ObjectSimulation::origin_of(scene.time));
    }
    if (scene.time.has_objects())
        objects_ = std::make_unique<ObjectSimulation>(scene.time, joined_.get());
    if (!flesh_ && scene.time.carries())
        carried_ =
            std::make_unique<CarriedModel>(geometry_of(input_.model), input_.handles,
                                           input_.settings, scene.time.unit, *objects_);
}

Simulation::~Simulation() = default;

std::vector<std::string> Simulation::warnings() const
{
    std::vector<std::string> all = input_.warnings;
    if (flesh_)
        add_new(flesh_->warnings(), all);
    if (objects_)
        add_new(objects_->warnings(), all);
    if (carried_)
        add_new(carried_->session().warnings(), all);
    if (limited_ > 0)
        all.push_back(
            fmt::format("{} turns of joints were cut to their limits", limited_));
    if (inverted_ > 0)
        all.push_back(fmt::format(
            "up to {} of {} cells were turned inside out: shorter steps, stiffer flesh, "
            "or another law may bear it",
            inverted_, flesh_->body().flesh->lattice().cells.size()));
    return all;
}

std::int64_t Simulation::steps_done() const
{
    return flesh_ ? flesh_->steps_done() : objects_->steps_done();
}

void Simulation::step()
{
    is_drawn_ = false;
    if (!joined_)
    {
        if (flesh_)
            flesh_->step();
        if (objects_)
            objects_->step();
        return;
    }
    const Clock::time_point start = Clock::now();
    joined_->begin();
    objects_->step();
    FleshReport report;
    report.is_finite = joined_->state().u.allFinite() && joined_->state().v.allFinite();
    report.is_converged = report.is_finite; // else the objects' report says so
    flesh_->take_step(report.is_finite ? joined_->state() : flesh_->snapshot().state,
                      report, ms_since(start));
}

void Simulation::next_frame(const std::function<void()>& watch, bool wants_samples)
{
    do
    {
        step();
        if (watch)
            watch();
    } while (steps_done() < num_steps() && steps_done() % time().steps_a_frame() != 0);
    if (carried_)
        carried_->follow(*objects_, wants_samples);
}

SimulationReport Simulation::report()
{
    SimulationReport report;
    if (flesh_)
    {
        report = flesh_->report();
        limited_ += report.flesh->limited;
        inverted_ = std::max(inverted_, report.flesh->inverted);
    }
    if (objects_)
        report = flesh_ ? together(objects_->report(), report) : objects_->report();
    if (carried_ && !carried_->session().frames().empty())
    {
        report.cells = carried_->session().frames().back();
        const SolveReport& solve = report.cells->solve;
        if (solve.stop != Stop::Converged)
            report.problems.push_back(
                fmt::format("the cells did not converge ({}, gradient {:.3g})",
                            stop_name(solve.stop), solve.gradient));
    }
    return report;
}

const DeformedSamples& Simulation::deformed()
{
    if (carried_)
        return carried_->session().deformed();
    if (!std::exchange(is_drawn_, true))
        deformed_ = flesh_->deformed();
    return deformed_;
}

ShapesInTime Simulation::shapes(int around)
{
    ShapesInTime out;
    const auto add_model = [&]
    {
        Geometry& model = out.parts.emplace_back(input_.model->geometry);
        model.samples = deformed().samples;
    };
    if (flesh_)
    {
        add_model();
        if (Geometry obstacles = flesh_->obstacles(); !obstacles.samples.empty())
            out.parts.push_back(std::move(obstacles));
        out.joints = flesh_->joints();
        out.cells = flesh_->drawn_cells();
    }
    if (objects_)
        for (Eigen::Vector3d& x : out.parts.emplace_back(objects_->stage(around)).samples)
            x /= unit();
    if (carried_)
        add_model();
    return out;
}

} // namespace cellwarp::core
