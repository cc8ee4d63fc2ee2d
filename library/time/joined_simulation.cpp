// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/joined_simulation.h"

#include <algorithm>
#include <utility>

#include "io/base/error.h"
#include "io/base/number.h"
#include "library/time/drawn_flesh.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/pieces.h"
#include "solver/joined/flesh_object.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

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
    if (!flesh.contact.empty())
        refuse("skeleton.contact", "flesh that is joined to something touches nothing");
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

} // namespace

/// The flesh as an object whose places are points of its rest shape.
class JoinedSimulation::Holder final : public JoinedFlesh
{
public:
    Holder(FleshSimulation& flesh, std::string path, const Vector3d& origin)
        : flesh_(flesh), path_(std::move(path)), state_(flesh.snapshot().state)
    {
        const FleshModel& model = *flesh.body().model;
        const double unit = model.scene.time->unit;
        to_scene_.R = model.frame.axes.transpose();
        to_scene_.t = unit * model.to_model(Vector3d::Zero()) - origin;
    }

    ArticulableObject& object() override
    {
        if (!object_)
            object_ =
                std::make_unique<FleshObject>(*flesh_.body().flesh, state_, to_scene_);
        return *object_;
    }
    Vector3d place_at(const Vector3d& at, const std::string& where) override
    {
        const FleshPoint point = point_at(at, where);
        return to_scene_(point.place + at_point(point.shares, state_.u));
    }
    int add_place(const Vector3d& at, const std::string& where) override
    {
        object();
        places_.emplace_back(at, where);
        return object_->add_place(point_at(at, where));
    }

    /// Before and after a step of both.
    void begin()
    {
        if (lattice_ != flesh_.body().flesh)
            take_lattice();
        state_ = flesh_.snapshot().state;
        const std::int64_t steps = flesh_.steps_done();
        object_->lead(flesh_.motions_at(steps), flesh_.motions_at(steps + 1),
                      flesh_.time().dt);
    }
    const FleshState& state() const { return state_; }

private:
    FleshPoint point_at(const Vector3d& at, const std::string& where) const
    {
        const FleshBody& body = flesh_.body();
        const FleshModel& model = *body.model;
        const Vector3d x = model.to_metres(at / model.scene.time->unit);
        const Lattice& lattice = body.flesh->lattice();
        const int cell = body.octree ? piece_at(model.rest->material.grid,
                                                body.octree->pieces, x / model.metre)
                                     : drawn_cell_of(lattice, x);
        const std::optional<Vector3d> local =
            cell < 0 ? std::nullopt : local_place(lattice, cell, x);
        if (!local || local->minCoeff() < -kBeside || local->maxCoeff() > 1.0 + kBeside)
            throw malformed({path_, 0, where},
                            "the point (" + shortest(at.x()) + ", " + shortest(at.y()) +
                                ", " + shortest(at.z()) +
                                ") of the flesh, in metres, lies outside of it");
        return {shares_at(lattice, cell, *local), x};
    }

    void take_lattice()
    {
        lattice_ = flesh_.body().flesh;
        std::vector<FleshPoint> points;
        for (const auto& [at, where] : places_)
            points.push_back(point_at(at, where));
        state_ = flesh_.snapshot().state;
        object_->take(*lattice_, std::move(points));
    }

    FleshSimulation& flesh_;
    const std::string path_;
    Motion to_scene_;
    FleshState state_;
    std::shared_ptr<Flesh> lattice_ = flesh_.body().flesh;
    std::unique_ptr<FleshObject> object_;
    std::vector<std::pair<Vector3d, std::string>> places_;
};

JoinedSimulation::JoinedSimulation(std::shared_ptr<const Geometry> geometry,
                                   const SceneFile& scene, const RodScene& rods,
                                   const CellSettings& cells, bool is_tight,
                                   const HandleFile& handles)
    : flesh_(std::move(geometry), has_flesh_end(rods) ? without_settling(scene) : scene,
             cells, is_tight, handles),
      warnings_(rods.warnings)
{
    if (has_flesh_end(rods))
    {
        refuse_what_joints_cannot_hold(scene);
        if (!flesh_.body().held_points.guided.empty())
            throw malformed({scene.path, 0, "skeleton.held"},
                            "flesh that is joined to something is held wholly, at points "
                            "that lie on corners of cells or beside them");
        holder_ =
            std::make_unique<Holder>(flesh_, scene.path, Simulation::origin_of(rods));
    }
    rods_ = std::make_unique<Simulation>(rods, holder_.get());
}

JoinedSimulation::~JoinedSimulation() = default;

std::vector<std::string> JoinedSimulation::warnings() const
{
    std::vector<std::string> all = warnings_;
    all.insert(all.end(), flesh_.warnings().begin(), flesh_.warnings().end());
    all.insert(all.end(), rods_->warnings().begin(), rods_->warnings().end());
    return all;
}

void JoinedSimulation::step()
{
    if (!holder_)
    {
        flesh_.step();
        rods_->step();
        return;
    }
    const Clock::time_point start = Clock::now();
    holder_->begin();
    rods_->step();
    FleshReport report;
    report.is_finite = holder_->state().u.allFinite() && holder_->state().v.allFinite();
    report.is_converged = report.is_finite; // else the joined ones tell
    flesh_.take_step(report.is_finite ? holder_->state() : flesh_.snapshot().state,
                     report, ms_since(start));
}

void JoinedSimulation::next_frame(const std::function<void()>& watch)
{
    do
    {
        step();
        if (watch)
            watch();
    } while (flesh_.steps_done() < flesh_.num_steps() &&
             flesh_.steps_done() % flesh_.steps_a_frame() != 0);
}

} // namespace cellwarp::core
