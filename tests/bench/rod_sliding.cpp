// SPDX-License-Identifier: GPL-3.0-or-later
// What slides: beads on wires, ropes in holes and over pegs, friction; and the link of
// closed rods.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <stdexcept>
#include <tuple>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "solver/dynamics/implicit_stepper.h"
#include "solver/dynamics/rigid_body.h"
#include "solver/rods/point_springs.h"
#include "solver/rods/rod_object.h"
#include "solver/rods/rod_stepper.h"
#include "tests/bench/rod_answers.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;
constexpr double kPi = std::numbers::pi, kGravity = 9.81;

/// A slide over the whole of a rod, that starts at a parameter.
int add_slide(RodCase& rod, double s, double friction = 0.0)
{
    RodSlide slide;
    slide.begin = rod.begin();
    slide.end = rod.end();
    slide.sticks = slide.slips = friction;
    rod.model.slides.push_back(slide);
    rod.state.sliding.push_back(begun(slide, s));
    return static_cast<int>(rod.model.slides.size()) - 1;
}

/// A hole where the rod is at a parameter.
void add_hole(RodCase& rod, double s, double friction = 0.0)
{
    RodConstraint hole;
    hole.point = rod.state.at(s).place;
    hole.slide = add_slide(rod, s, friction);
    rod.model.constraints.push_back(hole);
}

/// A bead on a wire that is held so often that it keeps its shape.
struct BeadOnWire
{
    RodCase wire;
    VectorXd velocity;
    RodObject object;
    RigidBody bead{0.1, {1e-7, 1e-7, 1e-7}};
    Joint joint;

    BeadOnWire(const std::function<Vector3d(double)>& curve, int spans, double share,
               double friction)
        : wire(made(curve, spans)),
          velocity(VectorXd::Zero(wire.rod.layout().num_unknowns)), object(wire.model)
    {
        for (const RodSpan& span : wire.rod.spans())
            wire.hold(HoldKind::Point, span.begin, Vector3d::UnitZ());
        wire.hold(HoldKind::Point, wire.end(), Vector3d::UnitZ());
        const double s = wire.rod.arc_length().parameter(share);
        joint.object = {0, 1};
        joint.place = {object.add_sliding_place(add_slide(wire, s, friction)),
                       bead.add_place({0, 0, 0})};
        object.bind(wire.state, velocity);
        bead.gravity = {0, -kGravity, 0};
        bead.state.p = wire.state.at(s).place;
    }
    static RodCase made(const std::function<Vector3d(double)>& curve, int spans)
    {
        std::vector<Vector3d> points;
        for (int k = 0; k <= spans; ++k)
            points.push_back(curve(static_cast<double>(k) / spans));
        return RodCase(Rod(spline_through(points, false, 1),
                           [](double) {
                               return Section{1e9, {1e5, 1e5}, 1e5, 1.0, 1e-4, 0.01};
                           },
                           {}));
    }
    Sliding& sliding() { return wire.state.sliding[0]; }
    ImplicitStepper stepper() { return ImplicitStepper({&object, &bead}, {joint}); }
};

std::function<Vector3d(double)> incline(double degrees)
{
    const double a = degrees * kPi / 180.0;
    return [a](double x) -> Vector3d
    { return 6.0 * x * Vector3d(std::cos(a), -std::sin(a), 0.0); };
}

void advance(ImplicitStepper& stepper, double step)
{
    if (stepper.step(step).stop != MotionStop::Converged)
        throw std::runtime_error("a step did not converge");
}

/// Of a bead that starts at rest: implicit Euler goes step^2 a n (n + 1) / 2.
double acceleration(double friction)
{
    BeadOnWire scene(incline(30.0), 12, 0.1, friction);
    ImplicitStepper stepper = scene.stepper();
    const double step = 1e-3, begin = scene.bead.state.p.norm();
    const int count = 200;
    for (int k = 0; k < count; ++k)
        advance(stepper, step);
    return 2.0 * (scene.bead.state.p.norm() - begin) /
           (step * step * count * (count + 1));
}

/// How long a bead takes from where its wire, left of its lowest point, is at \p x to
/// \p below [s].
double time_to_below(const std::function<Vector3d(double)>& curve, double x, double below)
{
    BeadOnWire scene(curve, 40, 0.5, 0.0);
    const SplineBasis& basis = scene.wire.rod.basis();
    double low = basis.begin(), high = 0.5 * (basis.begin() + basis.end());
    // The wire may come back above: from below on.
    for (double s = high; s > basis.begin(); s -= 1e-3 * basis.end())
        if (scene.wire.state.at(s).place.x() < x)
        {
            low = s;
            break;
        }
    for (int k = 0; k < 60; ++k)
    {
        const double middle = 0.5 * (low + high);
        (scene.wire.state.at(middle).place.x() < x ? low : high) = middle;
    }
    scene.sliding().s = low;
    scene.bead.state.p = scene.wire.state.at(low).place;
    ImplicitStepper stepper = scene.stepper();
    const double step = 2.5e-4;
    double last = scene.bead.state.p.x();
    for (int k = 1;; ++k)
    {
        advance(stepper, step);
        const double now = scene.bead.state.p.x();
        if (now >= below)
            return step * (k - (now - below) / (now - last));
        last = now;
    }
}

void add_beads(Answers& answers)
{
    answers.begin("A bead on a wire, friction μ");
    answers.add("incline of 30°, μ = 0.3: acceleration [m/s²]", 2.3562872, 15,
                [] { return acceleration(0.3); });
    answers.add("incline of 30°, without friction [m/s²]", 0.5 * kGravity, 15,
                [] { return acceleration(0.0); });
    answers.add("incline of 30°: slips below μ", 0.57735027, 15,
                []
                {
                    // The acceleration falls in proportion to the friction.
                    const double a = acceleration(0.5), b = acceleration(0.57);
                    return 0.57 + b * 0.07 / (a - b);
                });
    answers.add(
        "incline of 30°, μ = 0.578: acceleration", 0.0, 15,
        [] { return acceleration(0.578); }, kGravity);
    for (const double step : {4e-3, 1e-3})
        answers.add(
            fmt::format("thrown with 2 m/s, μ = 0.8: stops after [m], steps of {} ms",
                        1e3 * step),
            1.0573242, 15,
            [&]
            {
                BeadOnWire scene(incline(30.0), 12, 0.1, 0.8);
                const Vector3d along = incline(30.0)(1.0).normalized();
                scene.bead.state.velocity = 2.0 * along;
                scene.sliding().mode = Sliding::Mode::Slips;
                scene.sliding().drive = 1.0;
                ImplicitStepper stepper = scene.stepper();
                const double begin = scene.bead.state.p.norm();
                while (scene.sliding().mode != Sliding::Mode::Sticks)
                    advance(stepper, step);
                return scene.bead.state.p.norm() - begin;
            });
    const double a = 0.25;
    const auto cycloid = [a](double x) -> Vector3d
    {
        const double t = kPi * (0.05 + 1.9 * x);
        return a * Vector3d(t - std::sin(t), std::cos(t) - 1.0, 0.0);
    };
    for (const double turn : {0.4, 1.2, 2.4})
        answers.add(
            fmt::format("on a cycloid, let go {:.0f}° from below: period / 4π √(a/g)",
                        turn * 180.0 / kPi),
            1.0, 43,
            [&]
            {
                const double x = a * (kPi - turn - std::sin(kPi - turn));
                return 4.0 * time_to_below(cycloid, x, a * kPi) /
                       (4.0 * kPi * std::sqrt(a / kGravity));
            });
    const auto hoop = [](double x) -> Vector3d
    {
        const double t = kPi * (1.8 * x - 0.9);
        return {std::sin(t), -std::cos(t), 0.0};
    };
    for (const auto& [from, ratio] :
         {std::pair(30.0, 1.0174087976), {60.0, 1.0731820071}})
        answers.add(
            fmt::format("on a hoop, let go {}° from below: period / 2π √(R/g)", from),
            ratio, 43,
            [&, angle = from]
            {
                return 4.0 * time_to_below(hoop, -std::sin(angle * kPi / 180.0), 0.0) /
                       (2.0 * kPi * std::sqrt(1.0 / kGravity));
            });
    answers.add(
        "on a wire that spins with 2 rad/s, from 1 m, after 1 s [m]", 3.7621957, 15,
        []
        {
            const auto wire = [](double angle)
            {
                return [angle](double x) -> Vector3d
                { return 5.0 * x * Vector3d(std::cos(angle), 0.0, std::sin(angle)); };
            };
            BeadOnWire scene(wire(0.0), 12, 0.2, 0.0);
            scene.bead.gravity.setZero();
            scene.bead.state.velocity = {0, 0, 2};
            ImplicitStepper stepper = scene.stepper();
            const double step = 5e-4;
            for (int k = 1; k <= 2000; ++k)
            {
                for (RodConstraint& hold : scene.wire.model.constraints)
                    hold.point = wire(2.0 * step *
                                      k)(scene.wire.rod.arc_length().at(hold.s) / 5.0);
                advance(stepper, step);
            }
            return scene.bead.state.p.norm();
        });
}

/// A rope over a frictionless peg: how fast the difference of its halves grows.
double growth(int points)
{
    const double L = 2.0, rate = std::sqrt(2.0 * kGravity / L);
    RodCase rope(straight_case(L, points, {1e5, {0.1, 0.1}, 0.1, 1.0, 1e-6, 0.01}));
    rope.model.gravity = {0, -kGravity, 0};
    add_hole(rope, 0.51 * L, 1e3);
    VectorXd velocity = VectorXd::Zero(rope.state.x().size());
    RodStepper stepper(rope.model, Integrator::ImplicitEuler);
    rope.model.viscosity = 5.0;
    const auto step = [&](double h)
    {
        if (!is_solved(stepper.step(rope.state, velocity, h).stop))
            throw std::runtime_error("a step did not converge");
    };
    for (int k = 0; k < 600; ++k)
        step(5e-3);
    rope.model.viscosity = 0.0;
    rope.model.slides[0].sticks = rope.model.slides[0].slips = 0.0;
    rope.state.sliding[0] = begun(rope.model.slides[0], 0.51 * L);
    velocity.setZero();
    const double h = 2.5e-4;
    std::array<double, 2> d = {};
    for (int k = 1; k <= 3000; ++k)
    {
        step(h);
        d[k > 2000] = rope.rod.arc_length().at(rope.state.sliding[0].s) - 0.5 * L;
        if (k == 2000)
            d[0] = d[k > 2000];
    }
    // cosh(r t_2) / cosh(r t_1) is what has grown.
    const double t1 = 2000 * h, t2 = 3000 * h;
    return bisected(0.5 * rate, 2.0 * rate,
                    [&](double r)
                    { return std::cosh(r * t2) / std::cosh(r * t1) < d[1] / d[0]; }) /
           rate;
}

/// A chain slides off a level table, through holes on it that its end leaves one by one,
/// the last at the edge: how fast what hangs over grows.
double off_a_table(int points)
{
    constexpr int kHoles = 12;
    const double L = 1.0, rate = std::sqrt(kGravity / L), over = 0.25;
    RodCase chain(straight_case(L, points, {1e5, {4e-4, 4e-4}, 4e-4, 1.0, 1e-6, 0.01}));
    chain.model.gravity = {0, -kGravity, 0};
    for (int k = 0; k < kHoles; ++k)
    {
        const double s = (1.0 - over) * L * (k + 0.5) / (kHoles - 0.5);
        RodConstraint hole;
        hole.point = {s, 0, 0};
        hole.slide = add_slide(chain, s, 1e3);
        chain.model.slides.back().leaves = true;
        chain.model.constraints.push_back(hole);
    }
    VectorXd velocity = VectorXd::Zero(chain.state.x().size());
    RodStepper stepper(chain.model, Integrator::ImplicitEuler);
    const auto step = [&](double h)
    {
        if (!is_solved(stepper.step(chain.state, velocity, h).stop))
            throw std::runtime_error("a step did not converge");
    };
    chain.model.viscosity = 20.0;
    for (int k = 0; k < 600; ++k)
        step(5e-3);
    chain.model.viscosity = 0.0;
    for (int k = 0; k < kHoles; ++k)
    {
        chain.model.slides[idx(k)].sticks = chain.model.slides[idx(k)].slips = 0.0;
        chain.state.sliding[idx(k)].mode = Sliding::Mode::Slips;
        chain.state.sliding[idx(k)].drive = 0.0;
    }
    velocity.setZero();
    const double h = 2.5e-4;
    std::array<double, 2> hangs = {};
    const int first = 800, last = 1800;
    for (int k = 1; k <= last; ++k)
    {
        step(h);
        const double now = L - chain.rod.arc_length().at(chain.state.sliding.back().s);
        if (k == first)
            hangs[0] = now;
        hangs[1] = now;
    }
    return bisected(0.5 * rate, 2.0 * rate,
                    [&](double r) {
                        return std::cosh(r * h * last) / std::cosh(r * h * first) <
                               hangs[1] / hangs[0];
                    }) /
           rate;
}

/// A rope through \p holes on an arc by \p turn [rad], or through one at a corner by so
/// much, drawn slowly: the ratio of its two pulls.
double drawn(int holes, double turn, double friction, int points)
{
    const double R = holes > 1 ? 0.5 : 0.0, T = 100.0;
    const auto on_arc = [&](double angle) -> Vector3d {
        return {R * std::sin(angle), R * std::cos(angle), 0.0};
    };
    const Vector3d out(std::cos(turn), -std::sin(turn), 0.0);
    std::vector<Vector3d> at;
    const int steps = holes > 1 ? static_cast<int>(std::lround(turn * 32.0 / kPi)) : 0;
    for (int k = 8; k > 0; --k)
        at.emplace_back(-k / 8.0, R, 0.0);
    for (int k = 0; k <= steps; ++k)
        at.push_back(on_arc(steps > 0 ? turn * k / steps : 0.0));
    for (int k = 1; k <= 8; ++k)
        at.push_back(on_arc(turn) + k / 8.0 * out);
    const int gaps = static_cast<int>(at.size()) - 1;
    RodCase rope(
        Rod(spline_through(at, false, std::max(1, points / gaps)),
            [holes](double)
            {
                const double bending = holes > 1 ? 0.002 : 0.6;
                return Section{
                    holes > 1 ? 1e7 : 1e6, {bending, bending}, bending, 1.0, 1e-6, 0.01};
            },
            {RodRest::Straight}));
    const SplineBasis& basis = rope.rod.basis();
    for (int k = 0; k < holes; ++k)
    {
        // Between the holes the rope goes straight: half a turn of them at each end.
        const double angle = holes > 1 ? turn * (k + 0.5) / holes : 0.0;
        RodConstraint hole;
        hole.point = on_arc(angle);
        // More than a turn comes to the same place again: the nearest around where the
        // arc's length says.
        const double share = (1.0 + R * angle) / (2.0 + R * turn);
        RodSlide around;
        around.begin = std::max(basis.begin(), (share - 0.05) * basis.end());
        around.end = std::min(basis.end(), (share + 0.05) * basis.end());
        hole.slide =
            add_slide(rope, nearest_parameter(around, rope.state, hole.point), friction);
        rope.model.constraints.push_back(hole);
    }
    rope.model.loads.push_back({rope.begin(), {-T, 0, 0}, {0, 0, 0}});
    RodConstraint hand;
    hand.hold = HoldKind::Plane; // it draws straight on
    hand.direction = -out;
    hand.s = rope.end();
    hand.point = rope.state.at(hand.s).place;
    rope.model.constraints.push_back(hand);
    rope.model.viscosity = 100.0;
    VectorXd velocity = VectorXd::Zero(rope.state.x().size());
    RodObject object(rope.model);
    object.bind(rope.state, velocity);
    Articulation alone({&object});
    const double h = 0.01, speed = 4e-5;
    double pull = 0.0;
    for (int k = 0; k < 1500; ++k)
    {
        rope.model.constraints.back().point += speed * h * out;
        object.start(h);
        if (!is_solved(alone.solve({}).stop))
            throw std::runtime_error("a step did not converge");
        object.finish();
        pull = -alone.multipliers(0).tail<1>()[0];
    }
    return pull / T;
}

/// What draws a rod of length 2 and bending stiffness 1 out of a sleeve of two holes, 2.6
/// spans apart, the second at its middle and \p off of a span, as a share of the \p load
/// across its tip; and the sine of the tip's angle.
struct Sleeve
{
    double force = 0.0, sine = 0.0;
};

Sleeve out_of_a_sleeve(int spans, double off, double load)
{
    RodCase rod(straight_case(2.0, spans + 3, {1e8, {1.0, 1.0}, 1.0, 1.0, 1e-6, 0.01}));
    const double span = 2.0 / spans, at = 0.5 * spans + off;
    add_hole(rod, at * span);
    add_hole(rod, (at - 2.6) * span);
    rod.model.loads.push_back({rod.end(), {0, -load, 0}, {0, 0, 0}});
    RodConstraint back;
    back.hold = HoldKind::Plane;
    back.direction = Vector3d::UnitX();
    rod.model.constraints.push_back(back);
    RodNewton newton(rod.model);
    if (newton.solve(rod.state).stop != MotionStop::Converged)
        throw std::runtime_error("an equilibrium was not found");
    return {std::abs(newton.multipliers()[6]) / load,
            -rod.state.at(rod.end()).first.normalized().y()};
}

void add_ropes(Answers& answers)
{
    answers.begin("Ropes over pegs and through holes");
    for (const int points : {43, 63})
        answers.add("over a frictionless peg: growth rate / √(2g/L)", 1.0, points,
                    [&] { return growth(points); });
    answers.add("chain of 1 m and 4e-4 N m² off a table: growth rate / √(g/L)", 1.0, 123,
                [] { return off_a_table(123); });
    const auto pressed = [](bool along)
    {
        RodCase rope(straight_case(2.0, 164, {1e6, {0.6, 0.6}, 0.6, 1.0, 1e-6, 0.01}));
        add_hole(rope, 1.0, 1.0);
        rope.model.loads.push_back({rope.begin(), {-100, 0, 0}, {0, 0, 0}});
        rope.model.loads.push_back({rope.end(), {0, -150, 0}, {0, 0, 0}});
        RodNewton newton(rope.model);
        if (newton.solve(rope.state).stop != MotionStop::Converged)
            throw std::runtime_error("an equilibrium was not found");
        const Vector3d force = newton.multipliers().head<3>();
        const Vector3d t = rope.state.at(rope.state.sliding[0].s).first.normalized();
        const double part = std::abs(force.dot(t));
        return along ? part : std::sqrt(force.squaredNorm() - part * part);
    };
    answers.add("pulls of 100 and 150 at a right angle: force along [N]", 50.0, 164,
                [&] { return pressed(true); });
    answers.add("the same: force across [N]", 173.2050808, 164,
                [&] { return pressed(false); });
    answers.add("one hole, 90°, μ = 0.3: ratio of pulls, exp(2 asinh(μ sin 45°))",
                1.523705, 163, [] { return drawn(1, 0.5 * kPi, 0.3, 160); });
    answers.add("eight holes, 90°, μ = 0.3: the same of eight turns", 1.600658, 67,
                [] { return drawn(8, 0.5 * kPi, 0.3, 64); });
    answers.add("eight holes, 90°, without friction", 1.0, 67,
                [] { return drawn(8, 0.5 * kPi, 0.0, 64); });
    for (const auto& [holes, turns, friction, wrapped] :
         {std::tuple(32, 0.5, 0.3, 2.566332),
          {32, 0.5, 0.5, 4.810477},
          {64, 1.0, 0.3, 6.586062}})
        answers.add(fmt::format("{} holes, {}°, μ = {}: beside a rope round a cylinder, "
                                "e^(μ b)",
                                holes, 360.0 * turns, friction),
                    wrapped, turns > 0.5 ? 243 : 147,
                    [&, n = holes, t = turns, mu = friction]
                    { return drawn(n, 2.0 * kPi * t, mu, t > 0.5 ? 240 : 144); });
    for (const auto& [alpha, share] : {std::pair(0.5, 0.242104),
                                       {1.0, 0.445159},
                                       {2.0, 0.704522},
                                       {5.0, 0.937498},
                                       {10.0, 0.990145}})
        answers.add(
            fmt::format("out of a sleeve of two holes, P L²/EI = {}: axial force / P",
                        alpha),
            share, 403,
            [&, load = alpha] { return out_of_a_sleeve(400, 0.0, load).force; });
    for (const double off : {0.0, 0.25, 0.5})
        answers.add(
            fmt::format("sleeve of two holes 2.6 spans apart, {} of a span off a knot: "
                        "axial force / (tip load · sin of the tip's angle)",
                        off),
            1.0, 43,
            [&]
            {
                const Sleeve told = out_of_a_sleeve(40, off, 2.0);
                return told.force / told.sine;
            });
}

/// Writhe of a closed curve as a polygon: the sum of the solid angles that pairs of its
/// sides see each other in. [Klenin00]
double writhe(const RodState& state, int count)
{
    const SplineBasis& basis = state.rod().basis();
    std::vector<Vector3d> p;
    for (int k = 0; k < count; ++k)
        p.push_back(
            state.at(basis.begin() + (basis.end() - basis.begin()) * k / count).place);
    double sum = 0.0;
    const auto at = [&](int k) { return p[idx(k % count)]; };
    for (int i = 2; i < count; ++i)
        for (int j = 0; j + 1 < i; ++j)
        {
            if (i == count - 1 && j == 0)
                continue;
            const Vector3d r13 = at(j) - at(i), r14 = at(j + 1) - at(i),
                           r23 = at(j) - at(i + 1), r24 = at(j + 1) - at(i + 1),
                           r34 = at(j + 1) - at(j), r12 = at(i + 1) - at(i);
            std::array<Vector3d, 4> n = {r13.cross(r14), r14.cross(r24), r24.cross(r23),
                                         r23.cross(r13)};
            for (Vector3d& one : n)
                if (const double length = one.norm(); length > 0.0)
                    one /= length;
            const auto angle = [&](int a, int b)
            { return std::asin(std::clamp(n[idx(a)].dot(n[idx(b)]), -1.0, 1.0)); };
            const double solid = angle(0, 1) + angle(1, 2) + angle(2, 3) + angle(3, 0);
            sum += r34.cross(r12).dot(r13) > 0.0 ? solid : -solid;
        }
    return sum / (2.0 * kPi);
}

void add_link(Answers& answers)
{
    answers.begin(
        "A ring with 0.7 turns put in, bent far out of its plane: twist and writhe "
        "add up to its link");
    for (const int points : {12, 24, 48, 96})
        answers.add("Tw + Wr", 0.7, points,
                    [&]
                    {
                        RodCase ring(ring_case(points, slender_section(1.0, 1.0 / 1.3),
                                               {.link = 0.7}));
                        for (int k = 0; k < 4; ++k)
                            ring.model.loads.push_back(
                                {ring.begin() + (ring.end() - ring.begin()) * k / 4.0,
                                 Vector3d(k % 2 ? 0.2 : -0.1, 0.05, k % 2 ? 0.8 : -0.8),
                                 Vector3d::Zero()});
                        ring.model.loads[1].force[1] -= 0.2;
                        ring.model.loads[0].force[0] -= 0.2;
                        ring.hold(HoldKind::Point, ring.begin(), Vector3d::UnitZ());
                        ring.hold(HoldKind::Tangent, ring.begin(),
                                  ring.state.at(ring.begin()).first.normalized());
                        ring.settle();
                        double twist = 0.0;
                        for (std::size_t e = 0; e < ring.rod.spans().size(); ++e)
                            twist += ring.state.twist(e);
                        return twist / (2.0 * kPi) + writhe(ring.state, 1920);
                    });
}

/// A rope that a spring at each end draws to and fro through a hole.
void add_long_run(Answers& answers)
{
    answers.begin(
        "100,000 steps of 0.1 ms: a rope slides to and fro through a hole, RK4");
    double energy = 0.0, violation = 0.0, way = 0.0;
    answers.add(
        "energy lost or won, of what moves", 0.0, 15,
        [&]
        {
            RodCase rope(
                straight_case(1.0, 15, {400.0, {0.02, 0.02}, 0.02, 1.0, 1e-4, 0.01}));
            add_hole(rope, 0.4);
            rope.model.terms.push_back(
                point_springs(rope.rod, {{rope.begin(), {-0.4, 0.5, 0}, 20.0, 0.2},
                                         {rope.end(), {1.3, -0.2, 0.2}, 20.0, 0.2}}));
            VectorXd velocity = VectorXd::Zero(rope.state.x().size());
            RodStepper stepper(rope.model, Integrator::RungeKutta);
            const double before = stepper.energy(rope.state, velocity);
            double moving = 0.0, low = 1.0, high = 0.0;
            for (int k = 0; k < 100000; ++k)
            {
                const StepReport report = stepper.step(rope.state, velocity, 1e-4);
                if (report.stop != MotionStop::Converged)
                    throw std::runtime_error("a step did not converge");
                violation = std::max(violation, report.violation);
                moving = std::max(moving, rope.model.mass().kinetic_energy(velocity));
                low = std::min(low, rope.state.sliding[0].s);
                high = std::max(high, rope.state.sliding[0].s);
            }
            way = high - low;
            energy = (stepper.energy(rope.state, velocity) - before) / moving;
            return energy;
        },
        1.0);
    answers.add(
        "largest violation [m]", 0.0, 15, [&] { return violation; }, 1.0);
    fmt::print(stderr, "the rope slid by {:.3g} m\n", way);
}

} // namespace

void add_sliding(Answers& answers)
{
    add_beads(answers);
    add_ropes(answers);
    add_link(answers);
    add_long_run(answers);
}

} // namespace cellwarp::core
