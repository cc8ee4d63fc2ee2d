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
#include "octree/base/rigid_motion.h"
#include "solver/joined/flesh_object.h"

namespace cellwarp::core
{

class JoinedFlesh
{
public:
    /// \p flesh must outlive it. \p path: of the scene, for messages; \p origin: what all
    /// places of the scene count from [m].
    JoinedFlesh(FleshSimulation& flesh, std::string path, const Eigen::Vector3d& origin);

    FleshObject& object();
    /// Where a point of it is now, in the axes of object(). \p at: at rest, in those of
    /// the scene [m]; \p where: the key of the joint. Throws Fault::Malformed for a point
    /// outside.
    Eigen::Vector3d place_at(const Eigen::Vector3d& at, const std::string& where);
    /// Number of it as a place of object().
    int add_place(const Eigen::Vector3d& at, const std::string& where);

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
