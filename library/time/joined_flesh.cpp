// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/joined_flesh.h"

#include <optional>

#include "io/base/error.h"
#include "io/base/number.h"
#include "library/time/drawn_flesh.h"
#include "library/time/held_points.h"
#include "library/time/key_motion.h"
#include "octree/pieces.h"

namespace cellwarp::core
{

using Eigen::Vector3d;

JoinedFlesh::JoinedFlesh(FleshSimulation& flesh, std::string path, const Vector3d& origin)
    : flesh_(flesh), path_(std::move(path)), state_(flesh.snapshot().state),
      lattice_(flesh.body().flesh)
{
    const FleshModel& model = *flesh.body().model;
    const double unit = model.scene.time.unit;
    to_scene_.R = model.frame.axes.transpose();
    to_scene_.t = unit * model.to_model(Vector3d::Zero()) - origin;
}

FleshObject& JoinedFlesh::articulable()
{
    if (!object_)
        object_ = std::make_unique<FleshObject>(*flesh_.body().flesh, state_, to_scene_);
    return *object_;
}

Vector3d JoinedFlesh::place_of(const JointEnd& end, const std::string& where) const
{
    const FleshPoint point = point_at(vector_of(end.point), where);
    return to_scene_(point.place + at_point(point.shares, state_.u));
}

int JoinedFlesh::add_place(const JointEnd& end, const SlideStatement&,
                           const std::string& where, const Vector3d&)
{
    const Vector3d at = vector_of(end.point);
    articulable();
    places_.emplace_back(at, where);
    return object_->add_place(point_at(at, where));
}

void JoinedFlesh::begin()
{
    if (lattice_ != flesh_.body().flesh)
        take_lattice();
    state_ = flesh_.snapshot().state;
    const std::int64_t steps = flesh_.steps_done();
    object_->lead(flesh_.motions_at(steps), flesh_.motions_at(steps + 1),
                  flesh_.time().dt);
}

FleshPoint JoinedFlesh::point_at(const Vector3d& at, const std::string& where) const
{
    const FleshBody& body = flesh_.body();
    const FleshModel& model = *body.model;
    const Vector3d x = model.to_metres(at / model.scene.time.unit);
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

void JoinedFlesh::take_lattice()
{
    lattice_ = flesh_.body().flesh;
    std::vector<FleshPoint> points;
    for (const auto& [at, where] : places_)
        points.push_back(point_at(at, where));
    state_ = flesh_.snapshot().state;
    object_->take(*lattice_, std::move(points));
}

} // namespace cellwarp::core
