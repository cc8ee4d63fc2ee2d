// SPDX-License-Identifier: GPL-3.0-or-later
// Motion: pendulums, what steps of each rule keep and lose, stability from soft to stiff.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <fmt/format.h>

#include "solver/rods/rod_refinement.h"
#include "solver/rods/rod_stepper.h"
#include "tests/bench/rod_answers.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;
constexpr double kPi = std::numbers::pi;

const char* name_of(Integrator rule)
{
    return rule == Integrator::ImplicitEuler ? "implicit Euler"
           : rule == Integrator::Midpoint    ? "midpoint"
                                             : "RK4";
}

void add_pendulum(Answers& answers)
{
    answers.begin("A stiff rod swings from one end: period / that of a small swing, "
                  "2π √(2L/3g)");
    struct Row
    {
        double angle, ratio;
    };
    for (const Row& row : {Row{5, 1.0004761725},
                           {30, 1.0174087976},
                           {60, 1.0731820071},
                           {90, 1.1803405990},
                           {120, 1.3728805006},
                           {150, 1.7622037295}})
        answers.add(
            fmt::format("from {}°", row.angle), row.ratio, 4,
            [&]
            {
                const double g = 9.81, small = 2.0 * kPi * std::sqrt(2.0 / (3.0 * g));
                const double from = row.angle * kPi / 180.0;
                const std::vector<Vector3d> ends = {{0, 0, 0},
                                                    {std::sin(from), -std::cos(from), 0}};
                RodCase rod(Rod(spline_through(ends, false, 1),
                                [](double) {
                                    return Section{1e7, {1e5, 1e5}, 1e5, 1, 1e-6, 0.01};
                                },
                                {}));
                rod.model.gravity = {0, -g, 0};
                rod.hold(HoldKind::Point, rod.begin(), Vector3d::UnitZ());
                RodStepper stepper(rod.model, Integrator::Midpoint);
                VectorXd velocity = VectorXd::Zero(rod.state.x().size());
                const double h = 5e-4;
                double last = std::sin(from);
                for (int k = 1;; ++k)
                {
                    stepper.step(rod.state, velocity, h);
                    const double x = rod.state.at(rod.end()).place.x();
                    if (x <= 0.0)
                        return 4.0 * h * (k - 1 + last / (last - x)) / small;
                    last = x;
                }
            });
}

/// A bar that swings along itself in its first mode alone: linear.
struct Oscillator
{
    RodCase rod;
    VectorXd mode; ///< of unit mass
    double omega;

    Oscillator()
        : rod(straight_case(1.0, 4, {100.0, {1.0, 1.0}, 1.0, 1.0, 1e-2, 0.01})),
          omega(0.0)
    {
        const RodLayout& layout = rod.rod.layout();
        BandMatrix H, M(layout.num_unknowns, layout.half_band);
        rod.model.hessian(rod.state, RodHessian::Exact, H);
        rod.model.mass().add_to(M, 1.0);
        Eigen::Matrix4d K, mass;
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j)
            {
                const int a = layout.control[idx(std::max(i, j))],
                          b = layout.control[idx(std::min(i, j))];
                K(i, j) = a - b <= H.half_band() ? H.lower(a, b) : 0.0;
                mass(i, j) = a - b <= M.half_band() ? M.lower(a, b) : 0.0;
            }
        const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix4d> modes(K, mass);
        omega = std::sqrt(modes.eigenvalues()[1]);
        mode = VectorXd::Zero(layout.num_unknowns);
        for (int k = 0; k < 4; ++k)
            mode[layout.control[idx(k)]] = modes.eigenvectors()(k, 1);
    }
    /// Steps of z = omega h from a small deflection; each(place, speed / omega) after
    /// each.
    void run(Integrator rule, double z, int steps,
             const std::function<void(double, double)>& each)
    {
        const VectorXd rest = rod.state.x(), weighted = rod.model.mass().times(mode);
        const double size = 1e-3;
        rod.state.move(mode, size);
        VectorXd velocity = VectorXd::Zero(rest.size());
        RodStepper stepper(rod.model, rule);
        for (int k = 0; k < steps; ++k)
        {
            stepper.step(rod.state, velocity, z / omega);
            each(weighted.dot(rod.state.x() - rest) / size,
                 weighted.dot(velocity) / (size * omega));
        }
    }
};

void add_oscillator(Answers& answers)
{
    answers.begin("One mode of a bar, z = ω · step");
    for (const auto& [z, left] : {std::pair(0.01, 0.939),
                                  {0.05, 0.730},
                                  {0.1, 0.534},
                                  {0.2, 0.287},
                                  {0.5, 0.0486},
                                  {1.0, 0.0039}})
        answers.add(
            fmt::format("implicit Euler, z = {}: energy left after a period", z),
            std::pow(1.0 + z * z, -2.0 * kPi / z), 4,
            [&, z = z]
            {
                double energy = 1.0;
                constexpr int kSteps = 10;
                Oscillator().run(Integrator::ImplicitEuler, z, kSteps,
                                 [&](double x, double v) { energy = x * x + v * v; });
                return std::pow(energy, 2.0 * kPi / z / kSteps);
            },
            1.0);
    for (const auto& [z, ratio] : {std::pair(0.1, 0.999168), {0.5, 0.979915}})
        answers.add(
            fmt::format("midpoint, z = {}: frequency / true frequency", z), ratio, 4,
            [z = z]
            {
                double phase = 0.0;
                Oscillator().run(Integrator::Midpoint, z, 1,
                                 [&](double x, double v) { phase = std::atan2(-v, x); });
                return phase / z;
            });
    answers.add("midpoint, z = 0.5: energy after 100 steps", 1.0, 4,
                []
                {
                    double energy = 0.0;
                    Oscillator().run(Integrator::Midpoint, 0.5, 100,
                                     [&](double x, double v) { energy = x * x + v * v; });
                    return energy;
                });
    for (const auto& [z, size] :
         {std::pair(0.1, 0.9999999931), {0.5, 0.99989488}, {1.0, 0.993905}})
        answers.add(fmt::format("RK4, z = {}: amplitude after a step", z), size, 4,
                    [z = z]
                    {
                        double amplitude = 0.0;
                        Oscillator().run(Integrator::RungeKutta, z, 1,
                                         [&](double x, double v)
                                         { amplitude = std::hypot(x, v); });
                        return amplitude;
                    });
}

/// A rod of rubber, 1 m, r = 1 cm, that flies, turns and swings.
struct Thrown
{
    RodCase rod;
    VectorXd velocity;

    explicit Thrown(int points, double young = 1e6)
        : rod(straight_case(1.0, points, Section::round(0.01, young, 0.3, 1000.0)))
    {
        velocity = VectorXd::Zero(rod.state.x().size());
        for (int k = 0; k < rod.rod.num_controls(); ++k)
        {
            const Vector3d p = rod.state.control(k);
            velocity.segment<3>(rod.rod.layout().control[idx(k)]) =
                Vector3d(0.3, 1.0 + 0.5 * std::sin(5.0 * p.x()), 0.2) +
                Vector3d(0, 0, 3).cross(p);
        }
    }
};

void add_drift(Answers& answers)
{
    answers.begin(
        "A free rod that flies, turns and swings: what 10,000 steps change, as a "
        "share");
    constexpr int kSteps = 10000, kPoints = 11;
    for (const Integrator rule :
         {Integrator::ImplicitEuler, Integrator::Midpoint, Integrator::RungeKutta})
    {
        const double h = rule == Integrator::RungeKutta ? 2e-4 : 1e-3;
        Thrown thrown(kPoints);
        RodCase& rod = thrown.rod;
        RodStepper stepper(rod.model, rule);
        const Vector3d momentum = rod.model.mass().momentum(thrown.velocity),
                       turning =
                           rod.model.mass().angular_momentum(rod.state, thrown.velocity);
        const double energy = stepper.energy(rod.state, thrown.velocity);
        const std::string name = fmt::format("{}, {} ms", name_of(rule), 1e3 * h);
        answers.add(
            name + ": momentum", 0.0, kPoints,
            [&]
            {
                for (int k = 0; k < kSteps; ++k)
                    stepper.step(rod.state, thrown.velocity, h);
                return (rod.model.mass().momentum(thrown.velocity) - momentum).norm() /
                       momentum.norm();
            },
            1.0);
        answers.add(
            name + ": angular momentum", 0.0, kPoints,
            [&]
            {
                return (rod.model.mass().angular_momentum(rod.state, thrown.velocity) -
                        turning)
                           .norm() /
                       turning.norm();
            },
            1.0);
        answers.add(
            name + ": energy", 0.0, kPoints,
            [&] { return stepper.energy(rod.state, thrown.velocity) / energy - 1.0; },
            1.0);
    }
    answers.begin("Free fall, 1 s in steps of 10 ms");
    for (const auto& [rule, exact] :
         {std::pair(Integrator::ImplicitEuler, 4.95405), {Integrator::Midpoint, 4.905}})
        answers.add(name_of(rule), exact, 6,
                    [rule = rule]
                    {
                        RodCase rod(straight_case(
                            1.0, 6, Section::round(0.01, 1e6, 0.3, 1000.0)));
                        rod.model.gravity = {0, -9.81, 0};
                        VectorXd velocity = VectorXd::Zero(rod.state.x().size());
                        RodStepper stepper(rod.model, rule);
                        for (int k = 0; k < 100; ++k)
                            stepper.step(rod.state, velocity, 0.01);
                        return -rod.state.at(rod.end()).place.y();
                    });
}

void add_stiffness(Answers& answers)
{
    answers.begin("A free damped rod, E [Pa] and step [ms]: steps of 100 in which energy "
                  "grew or that did not converge");
    for (const double young : {1e3, 1e6, 1e9, 1e12, 1e15})
        for (const double h : {1e-4, 1e-3, 5e-3, 1e-2, 3.3e-2})
            answers.add(
                fmt::format("{:.0e}, {}", young, 1e3 * h), 0.0, 20,
                [&]
                {
                    Thrown thrown(20, young);
                    RodCase& rod = thrown.rod;
                    rod.model.viscosity = 0.5;
                    RodStepper stepper(rod.model, Integrator::ImplicitEuler);
                    double energy = stepper.energy(rod.state, thrown.velocity);
                    int bad = 0;
                    for (int k = 0; k < 100; ++k)
                    {
                        const MotionStop stop =
                            stepper.step(rod.state, thrown.velocity, h).stop;
                        const double now = stepper.energy(rod.state, thrown.velocity);
                        bad +=
                            now > energy * (1.0 + 1e-7) || stop != MotionStop::Converged;
                        energy = now;
                    }
                    return static_cast<double>(bad);
                },
                1.0);
}

/// A turn of a helix, its material along the normal: each span twists by torsion *
/// length.
void add_helix(Answers& answers)
{
    answers.begin("Frames");
    for (const int spans : {12, 24})
    {
        const double radius = 1.0, rise = 0.5; // a radian
        const double torsion = rise / (radius * radius + rise * rise);
        const double length = 2.0 * kPi * std::hypot(radius, rise);
        std::vector<Vector3d> points;
        for (int k = -3; k <= spans + 3; ++k)
        {
            const double a = 2.0 * kPi * k / spans;
            points.emplace_back(radius * std::cos(a), radius * std::sin(a), rise * a);
        }
        answers.add(
            fmt::format("twist along a turn of a helix, {} spans [rad]", spans),
            torsion * length, spans + 9,
            [&]
            {
                const Rod rod(spline_through(points, false, 1),
                              [](double) { return slender_section(1.0, 1.0); }, {});
                const RodState state(rod);
                const auto normal_angle = [&](std::size_t e, int end)
                {
                    // Of the normal from the station's own vector.
                    const int station = rod.spans()[e].station[idx(end)];
                    const int place = end == 0 ? 0 : rod.num_places() - 1;
                    const Vector3d t = state.velocity(e, place).tangent;
                    const double a =
                        2.0 * kPi * (static_cast<double>(e) + end - 3) / spans;
                    Vector3d n(-std::cos(a), -std::sin(a), 0.0);
                    n = (n - n.dot(t) * t).normalized();
                    const Vector3d& own = state.reference(station);
                    return std::atan2(t.cross(own).dot(n), own.dot(n));
                };
                double sum = 0.0;
                for (std::size_t e = 3; e < 3 + idx(spans); ++e)
                    sum += std::remainder(normal_angle(e, 1) - normal_angle(e, 0) +
                                              state.winding(e),
                                          2.0 * kPi);
                return sum;
            });
    }
}

void add_knots(Answers& answers)
{
    answers.begin("Knots in: how far the curve moves, of its size");
    for (const int degree : {1, 2, 3, 4, 5})
        answers.add(
            fmt::format("degree {}", degree), 0.0, 9,
            [&]
            {
                Spline curve{
                    SplineBasis::open(degree, SplineBasis::clamped_knots(degree, 9)), {}};
                for (int k = 0; k < 9; ++k)
                    curve.controls.emplace_back(std::cos(1.3 * k), std::sin(2.1 * k),
                                                0.2 * k);
                const double end = curve.basis.end();
                Spline finer = curve;
                for (const double share : {0.11, 0.37, 0.5, 0.83})
                    finer = with_knot(finer, share * end);
                double worst = 0.0;
                for (int k = 0; k <= 100; ++k)
                    worst = std::max(worst, (finer.at(0.01 * k * end).place -
                                             curve.at(0.01 * k * end).place)
                                                .norm());
                return worst;
            },
            1.0);
}

/// Ten points on a bow, moving.
struct Bow
{
    RodCase rod;
    VectorXd velocity;

    explicit Bow(int points)
        : rod(straight_case(1.0, points, slender_section(1.0, 0.7))),
          velocity(VectorXd::Zero(rod.state.x().size()))
    {
        VectorXd bend = VectorXd::Zero(rod.state.x().size());
        for (int k = 0; k < points; ++k)
        {
            const double x = double(k) / (points - 1);
            const int first = rod.rod.layout().control[idx(k)];
            bend.segment<3>(first) = Vector3d(0, 0.5 * x * x, 0.2 * x * x * x);
            velocity.segment<3>(first) =
                Vector3d(std::sin(3 * x), 1 + x, std::cos(5 * x));
        }
        for (int k = 0; k < rod.rod.num_stations(); ++k)
            velocity[rod.rod.layout().angle[idx(k)]] = std::sin(7.0 * k);
        rod.state.move(bend);
    }
    MovingRod all() { return {rod.rod, rod.model, rod.state, velocity}; }
    const RodMass& mass() const { return rod.model.mass(); }
};

void add_changes(Answers& answers)
{
    answers.begin("What a knot and a cut change");
    const auto row =
        [&](const std::string& what, double exact, int points, const auto& get)
    {
        answers.add(
            what, exact, points,
            [points, get]
            {
                Bow bow(points);
                return get(bow);
            },
            1.0);
    };
    row("a knot in: mass − 1", 0.0, 10,
        [](Bow& bow)
        {
            insert_knot(bow.all(), 0.37 * bow.rod.end());
            return bow.mass().total() - 1.0;
        });
    row("a knot in: kinetic energy, after / before − 1", 0.0, 10,
        [](Bow& bow)
        {
            const double before = bow.mass().kinetic_energy(bow.velocity);
            insert_knot(bow.all(), 0.37 * bow.rod.end());
            return bow.mass().kinetic_energy(bow.velocity) / before - 1.0;
        });
    for (const int points : {9, 16, 32})
        row("a knot in: elastic energy, after / before − 1", 0.0, points,
            [](Bow& bow)
            {
                const double before = bow.rod.model.elastic_energy(bow.rod.state);
                insert_knot(bow.all(), 0.37 * bow.rod.end());
                return bow.rod.model.elastic_energy(bow.rod.state) / before - 1.0;
            });
    row("a knot in and out: kinetic energy, after / before − 1", 0.0, 10,
        [](Bow& bow)
        {
            const double before = bow.mass().kinetic_energy(bow.velocity),
                         s = 0.37 * bow.rod.end();
            insert_knot(bow.all(), s);
            remove_knot(bow.all(), idx(bow.rod.rod.basis().span_of(s)), 1e-6);
            return bow.mass().kinetic_energy(bow.velocity) / before - 1.0;
        });
    row("a cut at 0.4: mass before it", 0.4, 10,
        [](Bow& bow)
        {
            const double s = 0.4 * bow.rod.end();
            cut(bow.all(), s);
            const int first =
                bow.rod.rod.controls(idx(bow.rod.rod.basis().span_of(s)))[0];
            return bow.mass().weights().head(first).sum();
        });
    row("a cut at 0.4: momentum, after − before, of its size", 0.0, 10,
        [](Bow& bow)
        {
            const Vector3d before = bow.mass().momentum(bow.velocity);
            cut(bow.all(), 0.4 * bow.rod.end());
            return (bow.mass().momentum(bow.velocity) - before).norm() / before.norm();
        });
    row("a cut at 0.4: what the halves share of the mass matrix", 0.0, 10,
        [](Bow& bow)
        {
            const double s = 0.4 * bow.rod.end();
            cut(bow.all(), s);
            const int first =
                bow.rod.rod.controls(idx(bow.rod.rod.basis().span_of(s)))[0];
            VectorXd one = VectorXd::Zero(bow.velocity.size());
            for (int k = first; k < bow.rod.rod.num_controls(); ++k)
                one.segment<3>(bow.rod.rod.layout().control[idx(k)]).setOnes();
            const VectorXd held = bow.mass().times(one);
            double most = 0.0;
            for (int k = 0; k < first; ++k)
                most = std::max(
                    most, held.segment<3>(bow.rod.rod.layout().control[idx(k)]).norm());
            return most;
        });
}

} // namespace

void add_motion(Answers& answers)
{
    add_helix(answers);
    add_knots(answers);
    add_changes(answers);
    add_pendulum(answers);
    add_oscillator(answers);
    add_drift(answers);
    add_stiffness(answers);
}

} // namespace cellwarp::core
