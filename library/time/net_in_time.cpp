// SPDX-License-Identifier: GPL-3.0-or-later
#include <utility>
#include <vector>

#include "library/time/drawn_shapes.h"
#include "library/time/key_motion.h"
#include "library/time/object_in_time.h"
#include "solver/dynamics/spring_net.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Springs as thin tubes.
void add_net(const NetStatement& net, const std::vector<Vector3d>& points, int around,
             Geometry& out)
{
    constexpr double kThin = 0.05; // of the spring's length
    out.groups.push_back({net.name, out.num_faces(), 0});
    for (const NetStatement::Spring& spring : net.springs)
    {
        const auto rest = [&](std::size_t k)
        { return Vector3d(net.points[k][0], net.points[k][1], net.points[k][2]); };
        const Vector3d a = points[spring.node[0]], b = points[spring.node[1]];
        const double radius =
            kThin * (rest(spring.node[0]) - rest(spring.node[1])).norm();
        const Vector3d t = (b - a).normalized();
        if (!t.allFinite() || t.isZero())
            continue;
        Vector3d n = t.unitOrthogonal();
        const Vector3d m = t.cross(n);
        add_solid({ring(a, radius * n, radius * m, around),
                   ring(b, radius * n, radius * m, around)},
                  Colour{120, 166, 110}, out);
    }
    out.groups.back().end_face = out.num_faces();
}

SpringNet built(const NetStatement& of, const RodScene& scene, const Vector3d& origin)
{
    std::vector<Vector3d> points;
    for (const Triple& point : of.points)
        points.push_back(vector_of(point) - origin);
    std::vector<NetSpring> springs;
    for (const NetStatement::Spring& spring : of.springs)
        springs.push_back(
            {{static_cast<int>(spring.node[0]), static_cast<int>(spring.node[1])},
             spring.stiffness});
    SpringNet net(std::move(points),
                  Eigen::Map<const Eigen::VectorXd>(
                      of.masses.data(), static_cast<Eigen::Index>(of.masses.size())),
                  springs);
    net.gravity = vector_of(scene.gravity);
    net.damping = of.damping;
    for (const std::size_t point : of.fixed)
        net.hold(static_cast<int>(point));
    return net;
}

class NetInTime final : public ObjectInTime
{
public:
    NetInTime(const NetStatement& of, const RodScene& scene, const Vector3d& origin)
        : statement_(of), origin_(origin), net_(built(of, scene, origin))
    {
    }

    JointEnd::Kind kind() const override { return JointEnd::Kind::Net; }
    std::string name() const override { return statement_.name; }
    ArticulableObject& articulable() override { return net_; }
    Vector3d place_of(const JointEnd& end, const std::string&) const override
    {
        return net_.point(static_cast<int>(end.node));
    }
    int add_place(const JointEnd& end, const SlideStatement&, const std::string&,
                  const Vector3d&) override
    {
        return static_cast<int>(end.node);
    }
    bool is_held() const override { return !statement_.fixed.empty(); }

    void add_to(SimulationReport& report) const override
    {
        report.kinetic += net_.kinetic();
        report.elastic += net_.elastic();
        for (int k = 0; k < net_.num_points(); ++k)
        {
            const Vector3d momentum = net_.mass(k) * net_.velocity.segment<3>(3 * k);
            report.gravity -= net_.mass(k) * net_.gravity.dot(net_.point(k));
            add_from_origin(net_.mass(k), momentum, net_.point(k).cross(momentum),
                            origin_, net_.gravity, report);
        }
    }
    void add_to(int, SimulatedObjects& out) const override
    {
        out.nets.push_back({name(), points()});
    }
    void add_surface(int around, Geometry& out) const override
    {
        add_net(statement_, points(), around, out);
    }
    void add_to(Eigen::AlignedBox3d& box) const override
    {
        for (const Vector3d& point : points())
            box.extend(point);
    }

private:
    std::vector<Vector3d> points() const
    {
        std::vector<Vector3d> out;
        for (int k = 0; k < net_.num_points(); ++k)
            out.push_back(origin_ + net_.point(k));
        return out;
    }

    const NetStatement& statement_;
    const Vector3d origin_;
    SpringNet net_;
};

} // namespace

std::unique_ptr<ObjectInTime> net_in_time(const RodScene& scene, std::size_t index,
                                          const Vector3d& origin)
{
    return std::make_unique<NetInTime>(scene.nets[index], scene, origin);
}

} // namespace cellwarp::core
