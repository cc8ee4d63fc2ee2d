// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "library/time/drawn_shapes.h"
#include "library/time/key_motion.h"
#include "library/time/object_in_time.h"
#include "solver/dynamics/rigid_body.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// The ball or box of even density that has the body's mass and inertia.
void add_body(const BodyStatement& body, const Motion& pose, int around, Geometry& out)
{
    const Vector3d inertia(body.inertia[0], body.inertia[1], body.inertia[2]);
    out.groups.push_back({body.name, out.num_faces(), 0});
    std::vector<std::vector<Vector3d>> rings;
    if (inertia.maxCoeff() - inertia.minCoeff() <= 1e-9 * inertia.maxCoeff())
    {
        rings = globe(pose, std::sqrt(2.5 * inertia[0] / body.mass), around);
    }
    else
    {
        const Vector3d half =
            (3.0 / body.mass * (Vector3d::Constant(0.5 * inertia.sum()) - inertia))
                .cwiseMax(0.0)
                .cwiseSqrt();
        for (const double side : {-1.0, 1.0})
            rings.push_back(ring(pose(Vector3d(0, 0, side * half[2])),
                                 std::numbers::sqrt2 * half[0] * pose.R.col(0),
                                 std::numbers::sqrt2 * half[1] * pose.R.col(1), 4,
                                 0.25 * std::numbers::pi));
    }
    add_solid(rings, Colour{96, 139, 176}, out);
    out.groups.back().end_face = out.num_faces();
}

RigidBody built(const BodyStatement& of, const RodScene& scene, const Vector3d& origin)
{
    RigidBody body(of.mass, vector_of(of.inertia));
    body.gravity = vector_of(scene.gravity);
    body.state.p = of.place.translation - origin;
    body.state.R = motion_of(of.place, Vector3d::Zero()).R;
    body.state.velocity = vector_of(of.velocity);
    body.spin(vector_of(of.spin));
    return body;
}

class BodyInTime final : public ObjectInTime
{
public:
    BodyInTime(const BodyStatement& of, const RodScene& scene, const Vector3d& origin)
        : statement_(of), origin_(origin),
          body_(built(of, scene, origin)), rest_{body_.state.R, body_.state.p}
    {
    }

    JointEnd::Kind kind() const override { return JointEnd::Kind::Body; }
    std::string name() const override { return statement_.name; }
    ArticulableObject& articulable() override { return body_; }
    Vector3d place_of(const JointEnd& end, const std::string&) const override
    {
        return body_.state.p + body_.state.R * vector_of(end.point);
    }
    int add_place(const JointEnd& end, const SlideStatement&, const std::string&,
                  const Vector3d&) override
    {
        return body_.add_place(vector_of(end.point));
    }
    bool is_held() const override { return has_keys(); }

    double turned(double begin, double end) const override
    {
        return core::turned(statement_.keys, begin, end);
    }
    double first_turn() const override
    {
        return has_keys() ? std::abs(statement_.keys.front().move.degrees) : 0.0;
    }
    double largest_turn() const override
    {
        double largest = 0.0;
        for (const MoveKey& key : statement_.keys)
            largest = std::max(largest, std::abs(key.move.degrees));
        return largest;
    }
    void hold_at(double time, double share) override { lead({}, {time, share}, 0.0); }
    void lead(const KeyTime&, const KeyTime& to, double duration) override
    {
        if (!has_keys())
            return;
        const Motion motion = motion_at(statement_.keys, to.time, rest_.t, to.share);
        body_.lead(motion.R * rest_.R, motion(rest_.t), duration);
    }

    void add_to(SimulationReport& report) const override
    {
        if (has_keys())
            return;
        report.kinetic += body_.kinetic();
        report.gravity -= body_.mass() * body_.gravity.dot(body_.state.p);
        add_from_origin(body_.mass(), body_.mass() * body_.state.velocity,
                        body_.angular_momentum(), origin_, body_.gravity, report);
    }
    void add_to(int, SimulatedObjects& out) const override
    {
        out.bodies.push_back({name(), origin_ + body_.state.p, body_.state.R});
    }
    void add_surface(int around, Geometry& out) const override
    {
        add_body(statement_, {body_.state.R, origin_ + body_.state.p}, around, out);
    }
    void add_to(Eigen::AlignedBox3d& box) const override
    {
        const Vector3d at = origin_ + body_.state.p;
        box.extend(at - Vector3d::Constant(body_.size()));
        box.extend(at + Vector3d::Constant(body_.size()));
    }

private:
    bool has_keys() const { return !statement_.keys.empty(); }

    const BodyStatement& statement_;
    const Vector3d origin_;
    RigidBody body_;
    const Motion rest_; ///< keys count from it
};

} // namespace

std::unique_ptr<ObjectInTime> body_in_time(const RodScene& scene, std::size_t index,
                                           const Vector3d& origin)
{
    return std::make_unique<BodyInTime>(scene.bodies[index], scene, origin);
}

} // namespace cellwarp::core
