// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/joined_simulation.h"

#include <algorithm>
#include <utility>

#include "io/base/error.h"
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

} // namespace

JoinedSimulation::JoinedSimulation(std::shared_ptr<const Geometry> geometry,
                                   const SceneFile& scene, const CellSettings& cells,
                                   bool is_tight, const HandleFile& handles)
    : flesh_(std::move(geometry),
             has_flesh_end(scene.time) ? without_settling(scene) : scene, cells, is_tight,
             handles)
{
    if (has_flesh_end(scene.time))
    {
        refuse_what_joints_cannot_hold(scene);
        if (!flesh_.body().held_points.guided.empty())
            throw malformed({scene.path, 0, "skeleton.held"},
                            "flesh that is joined to something is held wholly, at points "
                            "that lie on corners of cells or beside them");
        joined_ = std::make_unique<JoinedFlesh>(flesh_, scene.path,
                                                Simulation::origin_of(scene.time));
    }
    rods_ = std::make_unique<Simulation>(scene.time, joined_.get());
}

JoinedSimulation::~JoinedSimulation() = default;

std::vector<std::string> JoinedSimulation::warnings() const
{
    std::vector<std::string> all = flesh_.warnings();
    all.insert(all.end(), rods_->warnings().begin(), rods_->warnings().end());
    return all;
}

void JoinedSimulation::step()
{
    if (!joined_)
    {
        flesh_.step();
        rods_->step();
        return;
    }
    const Clock::time_point start = Clock::now();
    joined_->begin();
    rods_->step();
    FleshReport report;
    report.is_finite = joined_->state().u.allFinite() && joined_->state().v.allFinite();
    report.is_converged = report.is_finite; // else the joined ones tell
    flesh_.take_step(report.is_finite ? joined_->state() : flesh_.snapshot().state,
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
