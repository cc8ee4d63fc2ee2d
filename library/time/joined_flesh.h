// SPDX-License-Identifier: GPL-3.0-or-later
// Flesh that rods, bodies and nets may be joined to: an object whose places are points of
// its rest shape.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "library/time/flesh_simulation.h"
#include "library/time/object_in_time.h"
#include "octree/base/rigid_motion.h"
#include "solver/joined/flesh_object.h"

namespace cellwarp::core
{

class JoinedFlesh final : public ObjectInTime
{
public:
    /// \p flesh must outlive it. \p path: of the scene, for messages; \p origin: what all
    /// places of the scene count from [m].
    JoinedFlesh(FleshSimulation& flesh, std::string path, const Eigen::Vector3d& origin);

    JointEnd::Kind kind() const override { return JointEnd::Kind::Flesh; }
    std::string name() const override { return "flesh"; }
    FleshObject& articulable() override;
    /// An end is a point at rest, in the axes of the scene. Throws Fault::Malformed for a
    /// point outside.
    Eigen::Vector3d place_of(const JointEnd& end,
                             const std::string& where) const override;
    int add_place(const JointEnd& end, const SlideStatement& slide,
                  const std::string& where, const Eigen::Vector3d& other) override;
    bool is_held() const override { return true; } ///< by its bones

    // FleshSimulation reports and draws it.
    void add_to(SimulationReport&) const override {}
    void add_to(int, SimulatedObjects&) const override {}
    void add_surface(int, Geometry&) const override {}
    void add_to(Eigen::AlignedBox3d&) const override {}

    /// Before a step: where the flesh is, and where its bones go.
    void begin();
    /// After the step.
    const FleshState& state() const { return state_; }

private:
    FleshPoint point_at(const Eigen::Vector3d& at, const std::string& where) const;
    void take_lattice();

    FleshSimulation& flesh_;
    const std::string path_;
    Motion to_scene_;
    FleshState state_;
    std::shared_ptr<Flesh> lattice_;
    std::unique_ptr<FleshObject> object_;
    std::vector<std::pair<Eigen::Vector3d, std::string>> places_;
};

} // namespace cellwarp::core
