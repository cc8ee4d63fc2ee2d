// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/simulation/simulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "io/error.h"
#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"
#include "solver/rods/elasticity.h"
#include "solver/rods/point_springs.h"
#include "solver/rods/rod_stepper.h"
#include "solver/rods/springs.h"
#include "solver/rods/tensor_stretch.h"

namespace cellwarp
{

namespace
{

Eigen::Vector3d vector_of(const Triple& t)
{
    return {t[0], t[1], t[2]};
}

/// Seen from \p origin.
std::vector<Eigen::Vector3d> vectors_of(const std::vector<Triple>& triples,
                                        const Eigen::Vector3d& origin)
{
    std::vector<Eigen::Vector3d> out;
    for (const Triple& t : triples)
        out.push_back(vector_of(t) - origin);
    return out;
}

/// Steps and forces are small beside the places of a scene far from the origin, and drown
/// in their rounding: everything is seen from one of its points.
Eigen::Vector3d origin_of(const RodScene& scene)
{
    if (scene.rods.empty())
        return Eigen::Vector3d::Zero();
    const RodStatement& rod = scene.rods.front();
    return vector_of((rod.points.empty() ? rod.through : rod.points).front());
}

/// Both sides of a tube, so that its twist is seen.
constexpr std::array<std::uint8_t, 3> kFront = {236, 145, 60}, kBack = {205, 208, 214};

/// Neighbours at the same place are one point.
std::vector<Eigen::Vector3d> merged(std::vector<Eigen::Vector3d> points, bool is_closed)
{
    points.erase(std::unique(points.begin(), points.end()), points.end());
    if (is_closed && points.size() > 1 && points.front() == points.back())
        points.pop_back();
    return points;
}

/// By its control points, with the knots that the statement asks for.
Spline by_controls(const RodStatement& rod, std::vector<Eigen::Vector3d> points)
{
    const int n = static_cast<int>(points.size()), degree = static_cast<int>(rod.degree);
    const auto made = [&](SplineBasis basis) -> Spline {
        return {std::move(basis), std::move(points)};
    };
    if (rod.spline == "catmull-rom")
        return made(SplineBasis::catmull_rom(n, rod.is_closed));
    if (rod.spline == "bezier")
    {
        if (rod.is_closed || (n % 3 != 1 && n > kMaxOrder) || n < 3)
            throw std::invalid_argument("Bezier pieces need 4, 7, 10, ... control "
                                        "points, or 3 to 8 of one piece, "
                                        "open");
        return made(
            SplineBasis::open(n % 3 == 1 ? 3 : n - 1, SplineBasis::bezier_knots(n)));
    }
    if (n < degree + 1)
        throw std::invalid_argument("needs at least degree + 1 = " +
                                    std::to_string(degree + 1) + " control points");
    if (rod.is_closed || rod.spline == "uniform")
    {
        if (!rod.is_closed)
            return made(SplineBasis::open(degree, SplineBasis::uniform_knots(degree, n)));
        std::vector<double> turn;
        for (int i = 0; i <= n; ++i)
            turn.push_back(i);
        return made(SplineBasis::closed(degree, turn));
    }
    // Mean parameters of the control points' own chord.
    std::vector<double> s = {0.0};
    for (int i = 1; i < n; ++i)
        s.push_back(s.back() + (points[idx(i)] - points[idx(i - 1)]).norm());
    return made(SplineBasis::open(degree, averaged_knots(s, degree)));
}

Spline curve_of(const RodStatement& rod, const Eigen::Vector3d& origin)
{
    if (!rod.points.empty())
        return by_controls(rod, merged(vectors_of(rod.points, origin), false));
    return spline_through(merged(vectors_of(rod.through, origin), rod.is_closed),
                          rod.is_closed, static_cast<int>(rod.spans),
                          static_cast<int>(rod.degree));
}

Section section_of(const RodStatement& rod, double share)
{
    const double at = share * static_cast<double>(rod.radius.size() - 1);
    const std::size_t k =
        std::min(idx(static_cast<int>(at)),
                 rod.radius.size() - std::min<std::size_t>(2, rod.radius.size()));
    const double next = k + 1 < rod.radius.size() ? rod.radius[k + 1] : rod.radius[k];
    const double radius =
        rod.radius[k] + (at - static_cast<double>(k)) * (next - rod.radius[k]);
    Section section = Section::round(radius, rod.young, rod.poisson, rod.density);
    if (rod.bending)
        section.bending = *rod.bending;
    if (rod.twisting)
        section.twist = *rod.twisting;
    return section;
}

Motion motion_of(const RodKey& key, const Eigen::Vector3d& about)
{
    const Eigen::Vector3d axis(key.rotate[0], key.rotate[1], key.rotate[2]);
    const Eigen::Matrix3d R =
        rotation_about(axis.normalized(), key.rotate[3] * std::numbers::pi / 180.0);
    return {R, about - R * about + vector_of(key.translate)};
}

/// Turns about one axis [degree].
struct OneAxis
{
    Eigen::Vector3d axis;
    double from = 0.0, to = 0.0;
};

/// Two keys that turn about the same axis, one way or the other; a key that does not turn
/// does so about any.
std::optional<OneAxis> one_axis(const RodKey& a, const RodKey& b)
{
    const auto axis_of = [](const RodKey& key)
    { return Eigen::Vector3d(key.rotate[0], key.rotate[1], key.rotate[2]).normalized(); };
    if (a.rotate[3] == 0.0)
        return OneAxis{axis_of(b), 0.0, b.rotate[3]};
    const double side = axis_of(a).dot(axis_of(b));
    if (b.rotate[3] == 0.0 || std::abs(side) > 1.0 - 1e-12)
        return OneAxis{axis_of(a), a.rotate[3], side < 0.0 ? -b.rotate[3] : b.rotate[3]};
    return std::nullopt;
}

/// How far keys turn between two times, there and back added up [degree].
double turned(const std::vector<RodKey>& keys, double begin, double end)
{
    double sum = 0.0;
    for (std::size_t k = 0; k + 1 < keys.size(); ++k)
    {
        const RodKey &a = keys[k], &b = keys[k + 1];
        const double within = std::min(end, b.time) - std::max(begin, a.time);
        if (within <= 0.0)
            continue;
        const std::optional<OneAxis> one = one_axis(a, b);
        sum += within / (b.time - a.time) * (one ? std::abs(one->to - one->from) : 180.0);
    }
    return sum;
}

/// Where keys have a place at a time: straight and evenly between two of them.
Motion motion_at(const std::vector<RodKey>& keys, double time,
                 const Eigen::Vector3d& about)
{
    if (keys.empty())
        return {};
    const auto next = std::find_if(keys.begin(), keys.end(),
                                   [&](const RodKey& key) { return key.time > time; });
    if (next == keys.begin())
        return motion_of(keys.front(), about);
    if (next == keys.end())
        return motion_of(keys.back(), about);
    const RodKey &a = *(next - 1), &b = *next;
    const double share = (time - a.time) / (b.time - a.time);
    RodKey between = a;
    for (std::size_t k = 0; k < 3; ++k)
        between.translate[k] += share * (b.translate[k] - a.translate[k]);
    if (const std::optional<OneAxis> one = one_axis(a, b))
    {
        for (const std::size_t k : {0u, 1u, 2u})
            between.rotate[k] = one->axis[static_cast<Eigen::Index>(k)];
        between.rotate[3] = one->from + share * (one->to - one->from);
        return motion_of(between, about);
    }
    // About one axis from the one to the other, by less than half a turn.
    const Motion from = motion_of(a, about), to = motion_of(b, about);
    const Eigen::Vector3d turn = rotation_vector(to.R * from.R.transpose());
    const double angle = turn.norm();
    const Eigen::Matrix3d R =
        angle > 0.0
            ? Eigen::Matrix3d(rotation_about(turn / angle, share * angle) * from.R)
            : from.R;
    return {R, about - R * about + vector_of(between.translate)};
}

/// Whether weight and loads cancel.
bool is_balanced(const RodModel& model)
{
    Eigen::Vector3d sum = model.mass().total() * model.gravity;
    double largest = sum.norm();
    for (const RodLoad& load : model.loads)
    {
        sum += load.force;
        largest = std::max(largest, load.force.norm());
    }
    return sum.norm() <= 1e-12 * largest;
}

} // namespace

struct Simulation::Body
{
    const RodStatement& statement;
    Rod rod;
    RodModel model;
    RodState state;
    Eigen::VectorXd velocity;
    /// Of each hold its first constraint, its rest place and frame.
    struct Held
    {
        const RodHold* hold;
        std::size_t first, count;
        Eigen::Vector3d place;
        Eigen::Matrix3d frame;
        Eigen::Vector3d curvature;
    };
    std::vector<Held> held;
    std::optional<RodStepper> stepper;
    double violation = 0.0;

    Body(const RodStatement& of, const Eigen::Vector3d& origin)
        : statement(of),
          rod(curve_of(of, origin), [&of](double share) { return section_of(of, share); },
              {of.is_straight_at_rest ? RodRest::Straight : RodRest::Given, of.rest_twist,
               of.link, of.energy == "discrete" ? 2 : 1}),
          model(rod), state(rod),
          velocity(Eigen::VectorXd::Zero(rod.layout().num_unknowns))
    {
        const bool is_exact = of.energy == "exact", is_discrete = of.energy == "discrete";
        model.terms.push_back(
            exact_elasticity(rod, {.has_stretch = is_exact,
                                   .has_bending = !(is_discrete && springs_bend(rod))}));
        if (is_discrete)
            model.terms.push_back(spring_elasticity(rod));
        else if (!is_exact)
            model.terms.push_back(tensor_stretch(rod));
    }
};

Simulation::~Simulation() = default;

Simulation::Simulation(const RodScene& scene) : scene_(scene), origin_(origin_of(scene))
{
    for (std::size_t r = 0; r < scene_.rods.size(); ++r)
    {
        const RodStatement& rod = scene_.rods[r];
        const std::string where = "rods[" + std::to_string(r) + "]";
        if (rod.energy == "discrete" &&
            (rod.degree != 3 || rod.spline == "bezier" || rod.spline == "catmull-rom"))
            throw malformed({scene_.path, 0, where + ".energy"},
                            "springs need a cubic spline, uniform or nonuniform");
        try
        {
            bodies_.push_back(std::make_unique<Body>(rod, origin_));
        }
        catch (const std::invalid_argument& error)
        {
            throw malformed({scene_.path, 0, where}, error.what());
        }
        Body& body = *bodies_.back();
        RodModel& model = body.model;
        model.gravity = vector_of(scene_.gravity);
        model.viscosity = scene_.viscosity / body.rod.section(0.5).mass;
        for (int k = 0; k < body.rod.num_controls(); ++k)
            body.velocity.segment<3>(body.rod.layout().control[idx(k)]) =
                vector_of(rod.velocity);
        const auto parameter = [&](double share)
        { return body.rod.arc_length().parameter(share); };
        for (const RodHold& hold : rod.holds)
        {
            const double s = parameter(hold.at);
            const CurvePoint at = body.state.at(s);
            body.held.push_back({&hold, model.constraints.size(), 0, at.place,
                                 body.state.frame(s), at.second});
            const auto add = [&](HoldKind kind)
            {
                RodConstraint constraint;
                constraint.hold = kind;
                constraint.s = s;
                model.constraints.push_back(constraint);
                ++body.held.back().count;
            };
            if (hold.has_point)
                add(HoldKind::Point);
            if (hold.has_tangent)
                add(HoldKind::Tangent);
            if (hold.has_twist)
                add(HoldKind::TwistAngle);
            if (hold.has_curvature)
                add(HoldKind::CurvatureVector);
        }
        for (const RodOn& on : rod.on)
        {
            RodConstraint constraint;
            constraint.s = parameter(on.at);
            constraint.point = vector_of(on.point) - origin_;
            constraint.hold = on.kind == RodOn::Kind::Point   ? HoldKind::Point
                              : on.kind == RodOn::Kind::Plane ? HoldKind::Plane
                                                              : HoldKind::Axis;
            if (on.kind != RodOn::Kind::Point)
                constraint.direction = vector_of(on.direction).normalized();
            if (on.kind == RodOn::Kind::Plane)
                constraint.point =
                    constraint.direction * (on.offset / vector_of(on.direction).norm()) -
                    origin_;
            model.constraints.push_back(constraint);
        }
        for (const RodPull& load : rod.loads)
            model.loads.push_back(
                {parameter(load.at), vector_of(load.force), vector_of(load.moment)});
        std::vector<PointSpring> springs;
        for (const RodSpringTo& spring : rod.springs)
        {
            PointSpring to{parameter(spring.at), vector_of(spring.point) - origin_,
                           spring.stiffness, 0.0};
            to.length =
                spring.length.value_or((body.state.at(to.s).place - to.point).norm());
            if (spring.stiffness > 0.0)
                springs.push_back(to);
            if (spring.damping > 0.0)
                model.drags.push_back({to.s, spring.damping});
        }
        const bool is_held = !model.constraints.empty() || !springs.empty();
        if (!springs.empty())
            model.terms.push_back(point_springs(body.rod, std::move(springs)));
        if (is_static() && !is_held && !is_balanced(model))
            throw malformed({scene_.path, 0, where},
                            "nothing holds it against its weight and loads: there is no "
                            "equilibrium (need fixed, on or springs)");
        move_holds(body, 0.0, 1.0);
        if (!model.constraints.empty())
            body.violation = model.violations(body.state).cwiseAbs().maxCoeff();
        const Integrator rule = scene_.integrator == "midpoint" ? Integrator::Midpoint
                                : scene_.integrator == "rk4"    ? Integrator::RungeKutta
                                                             : Integrator::ImplicitEuler;
        body.stepper.emplace(model, rule);
        if (rule != Integrator::RungeKutta)
            continue;
        if (const double limit = body.stepper->largest_step(body.state);
            scene_.dt > limit)
            throw malformed({scene_.path, 0, "simulate.dt"},
                            fmt::format("got {} s, rk4 is stable up to {:.4g} s with {} "
                                        "(implicit-euler and midpoint at any step)",
                                        scene_.dt, limit, rod.name));
    }
}

void Simulation::move_holds(Body& body, double time, double share)
{
    for (const Body::Held& held : body.held)
    {
        std::vector<RodKey> keys = held.hold->keys;
        for (RodKey& key : keys)
        {
            for (double& x : key.translate)
                x *= share;
            key.rotate[3] *= share;
        }
        const Motion motion = motion_at(keys, time, held.place);
        for (std::size_t k = held.first; k < held.first + held.count; ++k)
        {
            RodConstraint& constraint = body.model.constraints[k];
            constraint.point = motion(held.place);
            if (constraint.hold == HoldKind::Tangent)
                constraint.direction = motion.R * held.frame.col(2);
            if (constraint.hold == HoldKind::TwistAngle)
                constraint.direction = motion.R * held.frame.col(0);
            if (constraint.hold == HoldKind::CurvatureVector)
                constraint.direction = motion.R * held.curvature;
        }
    }
}

bool Simulation::is_static() const
{
    return scene_.integrator == "static";
}

std::int64_t Simulation::num_steps() const
{
    return is_static() ? 1 : std::llround(scene_.duration / scene_.dt);
}

std::int64_t Simulation::steps_a_frame() const
{
    return is_static()
               ? 1
               : std::max<std::int64_t>(1, std::llround(scene_.every / scene_.dt));
}

std::int64_t Simulation::last_frame() const
{
    const std::int64_t every = steps_a_frame();
    return (num_steps() + every - 1) / every;
}

void Simulation::next_frame(const std::function<void()>& watch)
{
    do
    {
        step();
        if (watch)
            watch();
    } while (done_ < num_steps() && done_ % steps_a_frame() != 0);
}

std::int64_t Simulation::steps_done() const
{
    return done_;
}

void Simulation::step()
{
    const double begin = static_cast<double>(done_) * scene_.dt;
    for (const std::unique_ptr<Body>& body : bodies_)
        is_static() ? settle(*body) : advance(*body, begin);
    ++done_;
}

/// Directions tell of turns below 90 degrees alone: larger ones go in parts.
int Simulation::parts_of(double turn)
{
    constexpr double kPart = 30.0, kMost = 4096.0; // [degree]
    return static_cast<int>(std::clamp(std::ceil(turn / kPart), 1.0, kMost));
}

void Simulation::settle(Body& body)
{
    double largest = 0.0;
    for (const Body::Held& held : body.held)
        for (const RodKey& key : held.hold->keys)
            largest = std::max(largest, std::abs(key.rotate[3]));
    const int parts = parts_of(largest);
    RodStop stop = RodStop::NotRun;
    for (int part = 1; part <= parts; ++part)
    {
        move_holds(body, scene_.duration, static_cast<double>(part) / parts);
        RodNewton newton(body.model);
        const RodNewtonReport report = newton.solve(body.state, nullptr, {});
        iterations_ += report.iterations;
        body.violation = report.violation;
        stop = report.stop;
    }
    take_stop(body, stop);
}

void Simulation::advance(Body& body, double begin)
{
    double largest = 0.0;
    for (const Body::Held& held : body.held)
    {
        const std::vector<RodKey>& keys = held.hold->keys;
        double turn = turned(keys, begin, begin + scene_.dt);
        if (done_ == 0 && !keys.empty()) // from rest to the first key at once
            turn += std::abs(keys.front().rotate[3]);
        largest = std::max(largest, turn);
    }
    const int parts = parts_of(largest);
    for (int part = 1; part <= parts; ++part)
    {
        const double share = static_cast<double>(part) / parts;
        move_holds(body, begin + share * scene_.dt, done_ == 0 ? share : 1.0);
        const RodStepReport report =
            body.stepper->step(body.state, body.velocity, scene_.dt / parts);
        iterations_ += report.iterations;
        body.violation = report.violation;
        take_stop(body, report.stop);
    }
}

void Simulation::take_stop(const Body& body, RodStop stop)
{
    if (stop == RodStop::Converged || stop_ != "converged")
        return;
    stop_ = stop_name(stop);
    stopped_ = body.statement.name;
    stopped_violation_ = body.violation;
}

SimulationReport Simulation::report()
{
    SimulationReport out;
    out.time = is_static() ? 0.0 : static_cast<double>(done_) * scene_.dt;
    for (const std::unique_ptr<Body>& body : bodies_)
    {
        const RodModel& model = body->model;
        out.kinetic += model.mass().kinetic_energy(body->velocity);
        out.elastic += model.elastic_energy(body->state);
        const Eigen::Vector3d momentum = model.mass().momentum(body->velocity);
        out.gravity += model.gravity_energy(body->state) -
                       model.mass().total() * model.gravity.dot(origin_);
        out.momentum += momentum;
        out.turning += model.mass().angular_momentum(body->state, body->velocity) +
                       origin_.cross(momentum);
        out.violation = std::max(out.violation, body->violation);
    }
    out.iterations = std::exchange(iterations_, 0);
    out.stop = std::exchange(stop_, "converged");
    out.is_converged = out.stop == "converged";
    out.stopped = std::exchange(stopped_, "");
    if (!out.is_converged)
        out.violation = std::max(out.violation, stopped_violation_);
    return out;
}

std::vector<SimulatedRod> Simulation::rods(int places) const
{
    std::vector<SimulatedRod> out;
    for (const std::unique_ptr<Body>& body : bodies_)
    {
        SimulatedRod rod;
        rod.name = body->statement.name;
        rod.length = ArcLength(body->state.curve()).total();
        rod.knots = static_cast<int>(body->rod.spans().size()) + 1;
        for (int k = 0; k < places; ++k)
            rod.curve.push_back(origin_ + body->state
                                              .at(body->rod.arc_length().parameter(
                                                  static_cast<double>(k) / (places - 1)))
                                              .place);
        out.push_back(std::move(rod));
    }
    return out;
}

void Simulation::add_tube(const Body& body, const Eigen::Vector3d& origin, int around,
                          Geometry& out)
{
    constexpr int kRings = 4; // a span
    const std::span<const RodSpan> spans = body.rod.spans();
    const bool is_closed = body.rod.basis().is_closed();
    const auto first = static_cast<std::uint32_t>(out.samples.size());
    out.groups.push_back({body.statement.name, out.num_faces(), 0});
    std::uint32_t rings = 0;
    const auto add_ring = [&](double s)
    {
        const Eigen::Matrix3d F = body.state.frame(s);
        const Eigen::Vector3d middle = origin + body.state.at(s).place;
        const double radius = body.rod.section_at(s).radius;
        for (int k = 0; k < around; ++k)
        {
            const double a = 2.0 * std::numbers::pi * k / around;
            const Eigen::Vector3d out_of =
                std::cos(a) * F.col(0) + std::sin(a) * F.col(1);
            out.samples.push_back(middle + radius * out_of);
            out.colours.push_back(std::cos(a) > 0.0 ? kFront : kBack);
        }
        ++rings;
    };
    for (const RodSpan& span : spans)
        for (int k = 0; k < kRings; ++k)
            add_ring(span.begin + (span.end - span.begin) * k / kRings);
    if (!is_closed)
        add_ring(spans.back().end);
    const auto count = static_cast<std::uint32_t>(around);
    const auto corner = [&](std::uint32_t ring, std::uint32_t k)
    { return first + ring % rings * count + k % count; };
    const auto end_face = [&] { out.face_ends.push_back(out.corners.size()); };
    for (std::uint32_t i = 0; i + (is_closed ? 0 : 1) < rings; ++i)
        for (std::uint32_t k = 0; k < count; ++k)
        {
            out.corners.insert(
                out.corners.end(),
                {corner(i, k), corner(i, k + 1), corner(i + 1, k + 1), corner(i + 1, k)});
            end_face();
        }
    for (const bool is_begin : {true, false})
    {
        if (is_closed)
            break;
        for (std::uint32_t k = 0; k < count; ++k)
            out.corners.push_back(is_begin ? corner(0, count - k) : corner(rings - 1, k));
        end_face();
    }
    out.groups.back().end_face = out.num_faces();
}

Geometry Simulation::surface(int around) const
{
    Geometry out;
    for (const std::unique_ptr<Body>& body : bodies_)
        add_tube(*body, origin_, around, out);
    return out;
}

} // namespace cellwarp
