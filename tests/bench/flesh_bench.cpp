// SPDX-License-Identifier: GPL-3.0-or-later
// What flesh costs, a row a size (nodes of the lattice):
//   part/PART/N      a part of a step: products, frames, forces, the preconditioner
//   step/Z/N/LEVELS  a step of 1/120 s of a bar that swings from one end,
//                    Z = h^2 E / (density edge^2), by levels or by Jacobi alone
//   frame/N          four steps, and the samples of a bar of N nodes carried along
//   scene/SAMPLE     a displayed frame (four steps) of a scene of samples/flesh
#include <cmath>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>

#include "io/formats/geometry_file.h"
#include "library/session/scene_settings.h"
#include "library/time/flesh_simulation.h"
#include "octree/base/segment.h"
#include "solver/flesh/bone_points.h"
#include "solver/flesh/flesh.h"
#include "solver/flesh/flesh_forces.h"
#include "solver/flesh/level_preconditioner.h"
#include "tests/support/flesh.h"

namespace
{

using namespace cellwarp::core;
using namespace cellwarp::core::support;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kStep = 1.0 / 120.0;

/// A bar three times as long as it is thick, of about so many nodes.
int across_of(std::int64_t nodes)
{
    return std::max(2, static_cast<int>(std::lround(std::cbrt(nodes / 3.2))));
}

Lattice swinging_bar(std::int64_t nodes)
{
    return bar_lattice(across_of(nodes), 3);
}

FleshMaterial stiff(std::int64_t nodes, double z)
{
    const double edge = 1.0 / across_of(nodes);
    return {z * 1000.0 * edge * edge / (kStep * kStep), 0.4, 1000.0};
}

bool is_held(const Vector3d& x)
{
    return x.x() < 1e-9;
}

void product(benchmark::State& state)
{
    const Lattice lattice = swinging_bar(state.range(0));
    FleshForces forces(lattice, std::vector<FleshMaterial>{{1e4, 0.4, 1000}}, {});
    std::mt19937 rng(1);
    const VectorXd x = random_field(lattice, rng, 0.01);
    VectorXd y;
    forces.follow(x);
    for (auto _ : state)
        forces.multiply(x, {1.0, 1e-4, 0.0}, y);
    state.counters["nodes"] = static_cast<double>(lattice.places.size());
    state.SetItemsProcessed(state.iterations() * std::int64_t(lattice.places.size()));
}

void follow(benchmark::State& state)
{
    const Lattice lattice = swinging_bar(state.range(0));
    FleshForces forces(lattice, std::vector<FleshMaterial>{{1e4, 0.4, 1000}}, {});
    std::mt19937 rng(1);
    const VectorXd x = random_field(lattice, rng, 0.01);
    for (auto _ : state)
        forces.follow(x);
    state.SetItemsProcessed(state.iterations() * std::int64_t(lattice.places.size()));
}

void preconditioner(benchmark::State& state)
{
    const Lattice lattice = swinging_bar(state.range(0));
    FleshForces forces(lattice, std::vector<FleshMaterial>{{1e4, 0.4, 1000}}, {});
    const BoundNodes nodes = bind_nodes(lattice.hanging, held_nodes(lattice, is_held));
    LevelPreconditioner B(lattice, nodes, forces.mean_blocks({1.0, 1e-4, 0.0}), true);
    VectorXd r = VectorXd::Random(Eigen::Index(3 * nodes.free.size())), z;
    for (auto _ : state)
        B.apply(r, z);
    state.SetItemsProcessed(state.iterations() * std::int64_t(lattice.places.size()));
}

void step(benchmark::State& state, double z, bool has_levels)
{
    Lattice lattice = swinging_bar(state.range(0));
    const double nodes = static_cast<double>(lattice.places.size());
    std::vector<HeldPoint> held = held_nodes(lattice, is_held);
    FleshSettings settings;
    settings.gravity = {0, 0, -9.81};
    settings.has_levels = has_levels;
    Flesh flesh(std::move(lattice), {stiff(state.range(0), z)}, std::move(held), {},
                settings);
    FleshState at = flesh.rest();
    flesh.step(at, kStep, std::vector<Motion>(1)); // makes the preconditioner
    std::int64_t cg_steps = 0;
    for (auto _ : state)
        cg_steps += flesh.step(at, kStep, std::vector<Motion>(1)).cg_steps;
    state.counters["nodes"] = nodes;
    state.counters["cg"] =
        static_cast<double>(cg_steps) / static_cast<double>(state.iterations());
    state.counters["frames/s"] = benchmark::Counter(
        0.25 * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}

/// A bar with two bones in its axis that bend it, z^2 = 130, by a law.
void law(benchmark::State& state, FleshLaw of)
{
    Lattice lattice = swinging_bar(state.range(0));
    const double nodes = static_cast<double>(lattice.places.size());
    const std::vector<BoneLine> lines = {{{0, 0.5, 0.5}, {1.5, 0.5, 0.5}, 0},
                                         {{1.5, 0.5, 0.5}, {3, 0.5, 0.5}, 1}};
    std::vector<std::vector<double>> distances(2);
    for (const Vector3d& x : lattice.places)
        for (std::size_t b = 0; b < 2; ++b)
        {
            const double t = nearest_share(lines[b].from, lines[b].to, x);
            distances[b].push_back(
                (lines[b].from + t * (lines[b].to - lines[b].from) - x).norm());
        }
    std::vector<FleshRegionShares> regions;
    if (of == FleshLaw::Regions)
        regions = shares_by_distance(lattice, distances, std::vector<int>{0, 1},
                                     2.0 / across_of(state.range(0)));
    std::vector<HeldPoint> held =
        points_on_bones(lattice, lines, [](int, const Vector3d&) { return true; });
    FleshSettings settings;
    settings.law = of;
    settings.gravity = {0, 0, -9.81};
    Flesh flesh(std::move(lattice), {stiff(state.range(0), 130)}, std::move(held), {},
                settings, std::move(regions));
    FleshState at = flesh.rest();
    std::vector<Motion> motions(2);
    const auto turn = [&](int step)
    {
        const double angle = 0.7 * std::sin(0.05 * step);
        motions[1].R = rotation_about(Vector3d::UnitZ(), angle);
        motions[1].t = Vector3d(1.5, 0.5, 0.5) - motions[1].R * Vector3d(1.5, 0.5, 0.5);
    };
    flesh.step(at, kStep, motions); // makes preconditioner and factors
    int count = 0;
    std::int64_t cg_steps = 0;
    for (auto _ : state)
    {
        turn(++count);
        cg_steps += flesh.step(at, kStep, motions).cg_steps;
    }
    state.counters["nodes"] = nodes;
    state.counters["cg"] = static_cast<double>(cg_steps) / count;
}

void scene(benchmark::State& state, const char* name)
{
    const SceneFile of =
        read_scene(std::string(CELLWARP_SAMPLES "/flesh/") + name + ".json");
    FleshSimulation simulation(
        std::make_shared<const Geometry>(read_geometry(of.model).geometry), of,
        settings_of(of).cells);
    std::int64_t frames = 0;
    double cg_steps = 0.0;
    const FleshSimulation::Snapshot start = simulation.snapshot();
    for (auto _ : state)
    {
        if (simulation.steps_done() >= simulation.num_steps())
            simulation.go_to(start);
        simulation.next_frame();
        benchmark::DoNotOptimize(simulation.deformed_live());
        ++frames;
    }
    cg_steps = static_cast<double>(simulation.report().flesh->cg_steps);
    state.counters["nodes"] =
        static_cast<double>(simulation.body().flesh->lattice().places.size());
    state.counters["cg"] = cg_steps / static_cast<double>(frames) /
                           static_cast<double>(simulation.steps_a_frame());
    state.counters["frames/s"] =
        benchmark::Counter(static_cast<double>(frames), benchmark::Counter::kIsRate);
}

const auto kSizes = {1000, 5000, 25000, 100000, 200000};

} // namespace

int main(int argc, char** argv)
{
    for (const int size : kSizes)
    {
        benchmark::RegisterBenchmark("part/product", product)->Arg(size);
        benchmark::RegisterBenchmark("part/follow", follow)->Arg(size);
        benchmark::RegisterBenchmark("part/preconditioner", preconditioner)->Arg(size);
    }
    for (const double z : {1.3, 130.0, 13000.0})
        for (const bool has_levels : {true, false})
            for (const int size : kSizes)
                benchmark::RegisterBenchmark(
                    ("step/" + std::to_string(static_cast<int>(z)) +
                     (has_levels ? "/levels" : "/jacobi"))
                        .c_str(),
                    [=](benchmark::State& state) { step(state, z, has_levels); })
                    ->Arg(size)
                    ->Unit(benchmark::kMillisecond);
    for (const auto& [name, of] : {std::pair{"regions", FleshLaw::Regions},
                                   {"cells", FleshLaw::Cells},
                                   {"linear", FleshLaw::Linear},
                                   {"stvk", FleshLaw::StVenantKirchhoff},
                                   {"neo-hookean", FleshLaw::NeoHookean}})
        for (const int size : {1000, 5000, 25000})
            benchmark::RegisterBenchmark((std::string("law/") + name).c_str(),
                                         [taken = of](benchmark::State& state)
                                         { law(state, taken); })
                ->Arg(size)
                ->Unit(benchmark::kMillisecond);
    for (const char* name : {"limb", "elbow", "walk", "belly", "tail", "press", "flop"})
        benchmark::RegisterBenchmark((std::string("scene/") + name).c_str(),
                                     [=](benchmark::State& state) { scene(state, name); })
            ->Unit(benchmark::kMillisecond)
            ->Iterations(90);
    benchmark::Initialize(&argc, argv);
    benchmark::RunSpecifiedBenchmarks();
}
