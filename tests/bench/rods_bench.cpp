// SPDX-License-Identifier: GPL-3.0-or-later
// What rods cost, a row a size:
//   part/PART/N         a part of a step with N control points
//   step/RULE/N         a step, and of implicit rules a Newton iteration
//   lenoir/SCENE/RULE   a step of 1 ms of the scenes of [Lenoir04], beside the time there
//   lenoir/shoelace/RULE/N  a lace through N eyelets, 28 points for 12, by springs
//   joined/SAMPLE       a step of 1 ms of a scene of samples/rods
//   slide/...           what sliding through a hole costs beside a fixed place and a
//   search peer/...            a cantilever that swings, in steps of 1 ms, and what is
//   wrong where
//                       it comes to rest: here, and by rigid segments
#include <cmath>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>

#include "io/scene/scene_file.h"
#include "library/time/object_simulation.h"
#include "solver/rods/elasticity.h"
#include "solver/rods/rod_newton.h"
#include "solver/rods/rod_refinement.h"
#include "solver/rods/rod_stepper.h"
#include "solver/rods/springs.h"
#include "solver/rods/tensor_stretch.h"
#include "tests/bench/pbd_rod.h"

namespace
{

using namespace cellwarp::core;
using Eigen::Vector3d;
using Eigen::VectorXd;

enum class Kind
{
    Exact,
    Continuous,
    Discrete
};

/// A rod of rubber with its model, hung up where it is asked to be.
struct Bench
{
    Rod rod;
    RodModel model;
    RodState state;
    VectorXd velocity;

    Bench(int points, double length, const Section& section, Kind kind = Kind::Exact,
          bool is_uniform = false)
        : rod(curve(points, length, is_uniform), [section](double) { return section; },
              {.coupled_spans = kind == Kind::Discrete ? 2 : 1}),
          model(rod), state(rod), velocity(VectorXd::Zero(state.x().size()))
    {
        const bool is_discrete = kind == Kind::Discrete;
        model.terms.push_back(exact_elasticity(
            rod, {.has_stretch = kind == Kind::Exact, .has_bending = !is_discrete}));
        if (is_discrete)
            model.terms.push_back(spring_elasticity(rod));
        if (kind == Kind::Continuous)
            model.terms.push_back(tensor_stretch(rod));
        model.gravity = {0, -9.81, 0};
        for (int k = 0; k < rod.num_controls(); ++k) // it swings
            velocity[rod.layout().control[idx(k)] + 2] =
                0.2 * std::sin(7.0 * k / rod.num_controls());
    }
    static Spline curve(int points, double length, bool is_uniform)
    {
        if (!is_uniform)
        {
            const std::vector<Vector3d> ends = {{0, 0, 0}, {length, 0, 0}};
            return spline_through(ends, false, points - 3);
        }
        std::vector<Vector3d> q;
        for (int k = 0; k < points; ++k)
            q.emplace_back(length * (k - 1) / (points - 3), 0.0, 0.0);
        return {SplineBasis::open(3, SplineBasis::uniform_knots(3, points)), q};
    }
};

/// 1 cm across, soft; the time step of 1 ms is in reach of RK4.
Section soft(int points, double length)
{
    const double h = length / (points - 3);
    // dt <= 0.41 h sqrt(rho / E), half of that.
    const double young = 1000.0 * std::pow(0.2 * h / 1e-3, 2);
    return Section::round(0.005, young, 0.3, 1000.0);
}

void part(benchmark::State& run, const std::string& which)
{
    const int n = static_cast<int>(run.range(0));
    Bench bench(n, 0.02 * n, Section::round(0.005, 1e6, 0.3, 1000.0));
    bench.state.move(bench.velocity, 0.01);
    VectorXd gradient;
    BandMatrix H;
    bench.model.hessian(bench.state, RodHessian::Exact, H);
    bench.model.mass().add_to(H, 1e6);
    SaddleSolver solver;
    solver.factorize(H, {}, {});
    const VectorXd step = VectorXd::Constant(bench.state.x().size(), 1e-9);
    VectorXd none(0), x;
    for (auto _ : run)
    {
        if (which == "gradient")
            bench.model.gradient(bench.state, gradient);
        else if (which == "hessian")
            bench.model.hessian(bench.state, RodHessian::Exact, H);
        else if (which == "factor")
            solver.factorize(H, {}, {});
        else if (which == "solve")
        {
            x = step;
            solver.solve(x, none);
        }
        else if (which == "move")
            bench.state.move(step);
        else
            benchmark::DoNotOptimize(bench.model.elastic_energy(bench.state));
    }
    run.counters["us_a_point"] =
        benchmark::Counter(1e-6 * n, benchmark::Counter::kIsIterationInvariantRate |
                                         benchmark::Counter::kInvert);
}

void step(benchmark::State& run, Integrator rule)
{
    const int n = static_cast<int>(run.range(0));
    const bool is_explicit = rule == Integrator::RungeKutta;
    Bench bench(n, 0.02 * n, Section::round(0.005, 1e6, 0.3, 1000.0));
    RodStepper stepper(bench.model, rule);
    std::int64_t iterations = 0, steps = 0;
    const double h =
        is_explicit ? std::min(1e-3, 0.9 * stepper.largest_step(bench.state)) : 1e-3;
    for (auto _ : run)
    {
        iterations += stepper.step(bench.state, bench.velocity, h).iterations;
        ++steps;
    }
    run.counters["us_a_point"] =
        benchmark::Counter(1e-6 * n, benchmark::Counter::kIsIterationInvariantRate |
                                         benchmark::Counter::kInvert);
    if (is_explicit)
        return;
    run.counters["iterations"] = static_cast<double>(iterations) / steps;
    run.counters["us_a_point_and_iteration"] = benchmark::Counter(
        1e-6 * n * static_cast<double>(iterations) / static_cast<double>(steps),
        benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

struct Scene
{
    const char* name;
    int rods, points;
    Kind kind;
    bool is_uniform, is_held;
    double published; ///< [ms]
};

void lenoir(benchmark::State& run, const Scene& scene, Integrator rule)
{
    std::vector<std::unique_ptr<Bench>> rods;
    std::vector<RodStepper> steppers;
    for (int r = 0; r < scene.rods; ++r)
    {
        rods.push_back(std::make_unique<Bench>(scene.points, 1.0, soft(scene.points, 1.0),
                                               scene.kind, scene.is_uniform));
        Bench& rod = *rods.back();
        if (scene.is_held) // on a stick, at three places
            for (const double share : {0.0, 0.5, 1.0})
            {
                RodConstraint ring;
                ring.hold = HoldKind::Axis;
                ring.s = rod.rod.arc_length().parameter(share);
                ring.point = rod.state.at(ring.s).place;
                ring.direction = Vector3d::UnitX();
                rod.model.constraints.push_back(ring);
            }
        steppers.emplace_back(rod.model, rule);
    }
    // A quarter of a second, again and again: later soft rods are crumpled, which none of
    // the scenes is about.
    constexpr int kAgain = 250;
    const RodState begin = rods[0]->state;
    const VectorXd velocity = rods[0]->velocity;
    int steps = 0;
    for (auto _ : run)
        for (std::size_t r = 0; r < rods.size(); ++r)
        {
            if (r == 0 && ++steps % kAgain == 0)
                for (const std::unique_ptr<Bench>& rod : rods)
                {
                    rod->state.move_to(begin.x());
                    rod->velocity = velocity;
                }
            if (steppers[r].step(rods[r]->state, rods[r]->velocity, 1e-3).stop !=
                MotionStop::Converged)
                run.SkipWithError("a step did not converge");
        }
    run.counters["published_ms"] = scene.published;
    run.counters["times_faster"] = benchmark::Counter(
        1e-3 * scene.published, benchmark::Counter::kIsIterationInvariantRate);
}

/// A lace in zigzag through eyelets at every second point, both ends pulled.
void shoelace(benchmark::State& run, Integrator rule)
{
    const int eyelets = static_cast<int>(run.range(0));
    std::vector<Vector3d> points = {{-1.0 / (eyelets + 1), 0.02, 0}};
    for (int k = 0; k < eyelets; ++k)
        points.emplace_back(k / (eyelets + 1.0), k % 2 ? 0.03 : -0.03, 0.0);
    points.emplace_back(eyelets / (eyelets + 1.0), 0.02, 0.0);
    const Section section = soft(2 * eyelets + 5, 1.0);
    const Rod rod(spline_through(points, false, 2, 3), [&](double) { return section; },
                  {.coupled_spans = 2});
    RodModel model(rod);
    model.terms.push_back(
        exact_elasticity(rod, {.has_stretch = false, .has_bending = false}));
    model.terms.push_back(spring_elasticity(rod));
    model.viscosity = 5.0;
    RodState state(rod);
    for (int k = 0; k < eyelets; ++k)
    {
        RodConstraint eyelet;
        eyelet.slide = k;
        eyelet.point = points[static_cast<std::size_t>(k + 1)];
        model.constraints.push_back(eyelet);
        RodSlide slide;
        slide.end = rod.basis().end();
        model.slides.push_back(slide);
        state.sliding.push_back(
            begun(slide, nearest_parameter(slide, state, eyelet.point)));
    }
    model.loads.push_back({0.0, {-0.02, 0, 0}, {0, 0, 0}});
    model.loads.push_back({rod.basis().end(), {0.02, 0, 0}, {0, 0, 0}});
    VectorXd velocity = VectorXd::Zero(state.x().size());
    const RodState begin = state;
    RodStepper stepper(model, rule);
    int steps = 0;
    for (auto _ : run)
    {
        if (++steps % 250 == 0)
        {
            state = begin;
            velocity.setZero();
        }
        if (stepper.step(state, velocity, 1e-3).stop != MotionStop::Converged)
            run.SkipWithError("a step did not converge");
    }
    run.counters["points"] = rod.num_controls();
    run.counters["rows"] = 3 * eyelets;
    if (eyelets != 12)
        return;
    run.counters["published_ms"] = 10.0;
    run.counters["times_faster"] =
        benchmark::Counter(1e-2, benchmark::Counter::kIsIterationInvariantRate);
}

/// A sample, its first quarter of a second again and again.
void joined(benchmark::State& run, const std::string& name, double published)
{
    RodScene scene = read_scene(CELLWARP_SAMPLES "/rods/" + name + ".json").time;
    scene.dt = 1e-3;
    auto simulation = std::make_unique<ObjectSimulation>(scene);
    for (auto _ : run)
    {
        if (simulation->steps_done() == 250)
            simulation = std::make_unique<ObjectSimulation>(scene);
        simulation->step();
    }
    const SimulationReport report = simulation->report();
    if (!report.is_converged)
        run.SkipWithError(report.stop.c_str());
    if (published > 0.0)
    {
        run.counters["published_ms"] = published;
        run.counters["times_faster"] = benchmark::Counter(
            1e-3 * published, benchmark::Counter::kIsIterationInvariantRate);
    }
}

/// A sample from its begin to its end, with steps of \p dt [s].
void touching(benchmark::State& run, const std::string& name, const std::string& rule,
              double dt, double published)
{
    RodScene scene = read_scene(CELLWARP_SAMPLES "/rods/" + name + ".json").time;
    scene.dt = dt;
    scene.integrator = rule;
    ObjectSimulation simulation(scene);
    int contacts = 0;
    double nearest = 1.0;
    for (auto _ : run)
    {
        simulation.step();
        run.PauseTiming();
        const SimulationReport report = simulation.report();
        if (!report.is_converged)
            run.SkipWithError(report.stop.c_str());
        contacts = std::max(contacts, report.contacts);
        nearest = std::min(nearest, report.nearest.value_or(1.0));
        run.ResumeTiming();
    }
    run.counters["contacts"] = contacts;
    run.counters["nearest"] = nearest;
    if (published > 0.0)
    {
        run.counters["published_ms"] = published;
        run.counters["times_faster"] = benchmark::Counter(
            1e-3 * published, benchmark::Counter::kIsIterationInvariantRate);
    }
}

/// A knot comes into a rod and goes again, with all that follows.
void knot_change(benchmark::State& run, Kind kind)
{
    const int points = static_cast<int>(run.range(0));
    Bench bench(points, 1.0, soft(points, 1.0), kind);
    const MovingRod all{bench.rod, bench.model, bench.state, bench.velocity};
    const double s = 0.503 * bench.rod.basis().end();
    for (auto _ : run)
    {
        insert_knot(all, s);
        if (!remove_knot(all, idx(bench.rod.basis().span_of(s)), 1.0))
            run.SkipWithError("the knot stayed");
    }
}

/// The same rod from nothing, for comparison.
void built_anew(benchmark::State& run, Kind kind)
{
    const int points = static_cast<int>(run.range(0));
    for (auto _ : run)
    {
        const Bench bench(points, 1.0, soft(points, 1.0), kind);
        benchmark::DoNotOptimize(bench.state.x().data());
    }
}

/// A rope of 50 points in a hole, by implicit steps: its parameter is an unknown like the
/// others; or it is fixed, and sought until nothing pulls along the rope.
void slide(benchmark::State& run, bool is_sought)
{
    constexpr double kStill = 1e-8; // of the force in the hole
    Bench bench(50, 1.0, soft(50, 1.0));
    RodSlide slide;
    slide.end = bench.rod.basis().end();
    RodConstraint hole;
    hole.s = 0.5 * slide.end;
    hole.point = bench.state.at(hole.s).place;
    if (!is_sought)
    {
        hole.slide = 0;
        bench.model.slides.push_back(slide);
        bench.state.sliding.push_back(begun(slide, hole.s));
    }
    bench.model.constraints.push_back(hole);
    RodObject object(bench.model);
    object.bind(bench.state, bench.velocity);
    Articulation alone({&object});
    const RodState begin = bench.state;
    const VectorXd velocity = bench.velocity;
    const auto step = [&]
    {
        object.start(1e-3);
        if (!is_solved(alone.solve({}).stop))
            run.SkipWithError("a step did not converge");
    };
    /// The force along the rope after a step with the hole at \p s, of all that acts.
    const auto pull = [&](double s)
    {
        bench.model.constraints[0].s = s;
        step();
        const Vector3d force = alone.multipliers(0).head<3>();
        return force.dot(bench.state.at(s).first.normalized()) / force.norm();
    };
    int steps = 0;
    double tries = 0.0;
    for (auto _ : run)
    {
        if (++steps % 250 == 0)
        {
            bench.state = begin;
            bench.velocity = velocity;
            bench.model.constraints[0].s = hole.s;
        }
        if (!is_sought)
        {
            step();
            object.finish();
            continue;
        }
        double s = bench.model.constraints[0].s, next = s + 1e-5 * slide.end;
        double before = pull(s);
        ++tries;
        while (std::abs(before) > kStill)
        {
            object.undo();
            const double now = pull(next);
            ++tries;
            const double better = next - now * (next - s) / (now - before);
            s = next;
            next = better;
            before = now;
        }
        object.finish();
    }
    if (is_sought)
        run.counters["tries"] = tries / steps;
}

// A cantilever under its own weight, q L^3 / EI = 1.5696: its tip sinks by 0.19046904 L.
constexpr double kWeight = 1.5696, kSunk = 0.19046904, kStep = 1e-3;
constexpr double kStretch = 1e4, kMass = 1.0;

void peer(benchmark::State& run)
{
    const int segments = static_cast<int>(run.range(0));
    PbdRod rod(1.0, segments, kStretch, 1.0, 0.77, kMass, 1e-4);
    rod.gravity = {0, -kWeight / kMass, 0};
    for (auto _ : run)
        rod.step(kStep);
    for (int k = 0; k < 3000; ++k)
    {
        rod.stop();
        rod.step(0.03);
    }
    run.counters["static_error"] = std::abs(-rod.tip().y() / kSunk - 1.0);
}

void ours(benchmark::State& run)
{
    const int points = static_cast<int>(run.range(0));
    Bench bench(points, 1.0, {kStretch, {1.0, 1.0}, 0.77, kMass, 1e-4, 0.02});
    bench.velocity.setZero();
    bench.model.gravity = {0, -kWeight / kMass, 0};
    const Eigen::Matrix3d frame = bench.state.frame(0.0);
    RodConstraint hold;
    bench.model.constraints.push_back(hold);
    hold.hold = HoldKind::Tangent;
    hold.direction = frame.col(2);
    bench.model.constraints.push_back(hold);
    hold.hold = HoldKind::TwistAngle;
    hold.direction = frame.col(0);
    bench.model.constraints.push_back(hold);
    RodStepper stepper(bench.model, Integrator::ImplicitEuler);
    for (auto _ : run)
        stepper.step(bench.state, bench.velocity, kStep);
    RodNewton(bench.model).solve(bench.state);
    run.counters["static_error"] =
        std::abs(-bench.state.at(bench.rod.basis().end()).place.y() / kSunk - 1.0);
}

const Scene kScenes[] = {
    {"free_rod_nonuniform", 1, 50, Kind::Exact, false, false, 7.69},
    {"free_rod_uniform", 1, 50, Kind::Exact, true, false, 5.73},
    {"four_rods_discrete", 4, 15, Kind::Discrete, false, false, 6.9},
    {"four_rods_continuous", 4, 15, Kind::Continuous, false, false, 8.9},
    {"bundle_discrete", 11, 15, Kind::Discrete, false, false, 7.1},
    {"four_short_continuous", 4, 10, Kind::Continuous, false, false, 5.0},
    {"curtain", 1, 30, Kind::Exact, false, true, 2.0},
};

} // namespace

int main(int count, char** arguments)
{
    for (const char* which : {"gradient", "hessian", "factor", "solve", "move", "energy"})
        benchmark::RegisterBenchmark((std::string("part/") + which).c_str(), part, which)
            ->Arg(50)
            ->Arg(500)
            ->Arg(10000)
            ->Arg(100000);
    for (const auto& [name, rule] :
         {std::pair("step/implicit_euler", Integrator::ImplicitEuler),
          {"step/midpoint", Integrator::Midpoint},
          {"step/rk4", Integrator::RungeKutta}})
        benchmark::RegisterBenchmark(name, step, rule)
            ->Arg(50)
            ->Arg(165)
            ->Arg(500)
            ->Arg(2000)
            ->Arg(10000)
            ->Arg(100000);
    for (const Scene& scene : kScenes)
        for (const auto& [name, rule] : {std::pair("rk4", Integrator::RungeKutta),
                                         {"implicit", Integrator::ImplicitEuler}})
            benchmark::RegisterBenchmark(
                (std::string("lenoir/") + scene.name + "/" + name).c_str(), lenoir, scene,
                rule)
                ->Unit(benchmark::kMicrosecond);
    for (const auto& [name, rule] : {std::pair("rk4", Integrator::RungeKutta),
                                     {"implicit", Integrator::ImplicitEuler}})
    {
        benchmark::RegisterBenchmark((std::string("lenoir/shoelace/") + name).c_str(),
                                     shoelace, rule)
            ->Arg(3)
            ->Arg(6)
            ->Arg(12)
            ->Arg(24)
            ->Arg(30)
            ->Unit(benchmark::kMicrosecond);
    }
    for (const auto& [name, is_sought] :
         {std::pair("slide/as_an_unknown", false), {"slide/fixed_and_sought", true}})
        benchmark::RegisterBenchmark(name, slide, is_sought)
            ->Unit(benchmark::kMicrosecond);
    for (const auto& [name, published] : {std::pair<const char*, double>("swing", 3.14),
                                          {"net", 10.3},
                                          {"hole", 0.0},
                                          {"lace", 0.0},
                                          {"suture", 0.0},
                                          {"slipknot", 0.0},
                                          {"necklace", 0.0}})
        benchmark::RegisterBenchmark((std::string("joined/") + name).c_str(), joined,
                                     name, published)
            ->Unit(benchmark::kMicrosecond);
    for (const auto& [name, kind] : {std::pair("knot_change/exact", Kind::Exact),
                                     {"knot_change/tensor", Kind::Continuous}})
        benchmark::RegisterBenchmark(name, knot_change, kind)
            ->Arg(15)
            ->Arg(50)
            ->Arg(165)
            ->Arg(500)
            ->Arg(2000)
            ->Unit(benchmark::kMicrosecond);
    for (const auto& [name, kind] : {std::pair("built_anew/exact", Kind::Exact),
                                     {"built_anew/tensor", Kind::Continuous}})
        benchmark::RegisterBenchmark(name, built_anew, kind)
            ->Arg(15)
            ->Arg(50)
            ->Arg(165)
            ->Arg(500)
            ->Arg(2000)
            ->Unit(benchmark::kMicrosecond);
    struct Touching
    {
        const char *name, *rule;
        double dt, published;
    };
    for (const Touching& of : {Touching{"knot_fixed", "implicit-euler", 1e-3, 2.16},
                               {"knot_fixed", "rk4", 1e-4, 2.16},
                               {"knot", "implicit-euler", 1e-3, 11.0},
                               {"knot", "rk4", 1e-4, 11.0},
                               {"pile", "implicit-euler", 1e-3, 7.1},
                               {"pile", "rk4", 1e-4, 7.1},
                               {"intestine", "implicit-euler", 1e-3, 14.0},
                               {"intestine", "rk4", 2e-4, 14.0}})
    {
        const RodScene scene =
            read_scene(CELLWARP_SAMPLES "/rods/" + std::string(of.name) + ".json").time;
        benchmark::RegisterBenchmark(
            (std::string("touching/") + of.name + "/" + of.rule).c_str(), touching,
            of.name, of.rule, of.dt, of.published)
            ->Iterations(static_cast<std::int64_t>(scene.duration / of.dt))
            ->Unit(benchmark::kMicrosecond);
    }
    benchmark::RegisterBenchmark("peer/rigid_segments", peer)
        ->Arg(50)
        ->Unit(benchmark::kMicrosecond);
    benchmark::RegisterBenchmark("peer/ours", ours)
        ->Arg(5)
        ->Arg(6)
        ->Arg(7)
        ->Arg(8)
        ->Arg(11)
        ->Unit(benchmark::kMicrosecond);
    benchmark::Initialize(&count, arguments);
    if (benchmark::ReportUnrecognizedArguments(count, arguments))
        return 1;
    benchmark::RunSpecifiedBenchmarks();
    return 0;
}
