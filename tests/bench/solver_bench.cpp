// SPDX-License-Identifier: GPL-3.0-or-later
// How the parts of a solve, whole solves and frames of a drag grow, beside the textbook's
// way: factors. Bars of 4 x 1 x 1, two layers of cells held at each end, one end turned
// or moved. Every time is the median of single calls, so one row a size will do:
//   FAMILY/CELLS            a part of a solve, or a solve by 45 degrees
//   frame/SAMPLES, frame_cells/CELLS    a frame; its counters X_ms are parts of it
//   case/NAME/METHOD        solves to the end, in one jump: steps of each method
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "io/formats/geometry_file.h"
#include "io/scene/handle_file.h"
#include "library/session/drag.h"
#include "octree/base/clock.h"
#include "solver/cells/rigid_multigrid.h"
#include "solver/minimize/newton.h"
#include "tests/support/allocations.h"
#include "tests/support/shapes.h"

namespace
{

using namespace cellwarp::core;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Counters = benchmark::UserCounters;

double median(std::vector<double> values)
{
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Of single calls: three at least, unless they take too long. \p prepare is not timed.
template <class Prepare, class Call>
double median_seconds(const Prepare& prepare, const Call& call)
{
    constexpr double kEnough = 0.3, kTooLong = 5.0; // [s]
    std::vector<double> seconds;
    const Clock::time_point begin = Clock::now();
    while (seconds.empty() ||
           seconds_since(begin) < (seconds.size() < 3 ? kTooLong : kEnough))
    {
        prepare();
        const Clock::time_point start = Clock::now();
        call();
        seconds.push_back(seconds_since(start));
    }
    return median(std::move(seconds));
}

template <class Call>
double median_seconds(const Call& call)
{
    return median_seconds([] {}, call);
}

void assemble(const BlockOperator& H, BlockMatrix& matrix)
{
    for (int b = 0; b < matrix.num_blocks(); ++b)
        H.diagonal_block(b, matrix.diagonal(b));
    for (std::size_t p = 0; p < H.pairs().size(); ++p)
    {
        const auto& [row, column] = H.pairs()[p];
        H.pair_block(static_cast<int>(p), matrix.block(matrix.find(row, column)));
    }
}

BlockMatrix assembled(const BlockOperator& H)
{
    const std::span<const std::pair<int, int>> pairs = H.pairs();
    BlockMatrix matrix(H.block_sizes(), {pairs.begin(), pairs.end()});
    assemble(H, matrix);
    return matrix;
}

/// What stands in the multigrid's place in the textbook: one factor for all motions, that
/// of the energy as linearised, at rest.
class RestFactor final : public Preconditioner
{
public:
    explicit RestFactor(const BlockOperator& H) : matrix_(assembled(H)), factor_(matrix_)
    {
        factorize();
    }
    void factorize()
    {
        if (!factor_.factorize(matrix_))
            throw std::runtime_error("the matrix at rest is not positive definite");
    }
    void apply(const VectorXd& r, VectorXd& z) override { factor_.solve(r, z); }
    double bytes() const { return 8.0 * factor_.factor_numbers(); }

private:
    BlockMatrix matrix_;
    SparseCholesky factor_;
};

/// A bar of cells along x, how much of its ends is held, and where one goes.
struct Task
{
    int along = 0, across = 0, layers = 2;
    Motion motion = {}; ///< of the upper end

    int num_cells() const { return along * across * across; }
    /// From 0 at the lower end's face to \p along: where the middle of the axis is.
    Vector3d on_axis(double x) const { return {x, 0.5 * across, 0.5 * across}; }
};

Motion turned_about(const Vector3d& point, const Vector3d& axis, double degrees)
{
    const Eigen::Matrix3d R = rotation_about(axis, degrees / 180.0 * std::numbers::pi);
    return {R, point - R * point};
}

/// What a solve needs, at rest. Its preconditioners are made when first asked for.
class System
{
public:
    explicit System(const Task& task)
        : task_(task), built_(support::bar(task.along, task.across, task.across)),
          glue_(build_glue(built_.cells, {})), constraints_(built_.cells.size())
    {
        for (std::size_t c = 0; c < built_.cells.size(); ++c)
        {
            const double x = built_.cells.cells[c].centre.x();
            const int region = x < task.layers                ? 0
                               : x > task.along - task.layers ? 1
                                                              : -1;
            region_of_cell_.push_back(region);
            if (region >= 0)
                constraints_[c].hold = Hold::Prescribed;
            else
                free_cells_.push_back(static_cast<int>(c));
            rest_.push_back(carried({}, built_.cells.cells[c].centre));
        }
        energy_.emplace(built_.cells, glue_, constraints_,
                        find_components(built_.cells, constraints_));
    }

    CellEnergy& energy() { return *energy_; }
    /// Only the end has moved.
    std::vector<Pose> jumped() const
    {
        std::vector<Pose> poses = rest_;
        for (std::size_t c = 0; c < poses.size(); ++c)
            if (region_of_cell_[c] == 1)
                poses[c] = carried(task_.motion, built_.cells.cells[c].centre);
        return poses;
    }
    InitialGuess spread() const
    {
        return {built_.cells, glue_, constraints_,
                std::vector<Driving>(region_of_cell_.begin(), region_of_cell_.end()), 2};
    }
    /// The other cells have been carried along, as a session does.
    const std::vector<Pose>& start()
    {
        if (start_.empty())
        {
            start_ = jumped();
            spread().carry(std::vector<Motion>{{}, task_.motion}, free_cells_, start_);
        }
        return start_;
    }
    /// What a session measures the gradient by.
    double gradient_scale()
    {
        VectorXd gradient;
        energy_->state.set_poses(jumped());
        energy_->total.gradient(gradient);
        return std::max(gradient.norm(), 1e-3 * energy_->glue.uncancelled());
    }
    void linearise_at_rest()
    {
        energy_->state.set_poses(rest_);
        energy_->total.linearise(kGaussNewton);
    }
    void linearise_at_start()
    {
        energy_->state.set_poses(start());
        energy_->total.linearise(kExact);
    }
    RigidMultigrid new_multigrid() const
    {
        return {energy_->total, energy_->bodies(grid_places(built_.cells))};
    }
    RigidMultigrid& multigrid()
    {
        if (!multigrid_)
        {
            linearise_at_rest();
            multigrid_.emplace(new_multigrid());
        }
        return *multigrid_;
    }
    RestFactor& rest_factor()
    {
        if (!rest_factor_)
        {
            linearise_at_rest();
            rest_factor_ = std::make_unique<RestFactor>(energy_->total);
        }
        return *rest_factor_;
    }

private:
    Task task_;
    support::Built built_;
    Glue glue_;
    std::vector<Constraint> constraints_;
    std::vector<int> region_of_cell_, free_cells_;
    std::vector<Pose> rest_, start_;
    std::optional<CellEnergy> energy_;
    std::optional<RigidMultigrid> multigrid_;
    std::unique_ptr<RestFactor> rest_factor_;
};

double linearise(System& system, Counters&)
{
    system.linearise_at_start();
    return median_seconds([&] { system.energy().total.linearise(kExact); });
}

/// A vector to multiply, as a solve has it.
VectorXd gradient_at_start(System& system)
{
    VectorXd gradient;
    system.linearise_at_start();
    system.energy().total.gradient(gradient);
    return gradient;
}

double multiply(System& system, Counters&)
{
    const VectorXd x = gradient_at_start(system);
    VectorXd y(x.size());
    return median_seconds([&] { system.energy().total.multiply(x, y); });
}

double apply(System& system, Preconditioner& preconditioner)
{
    const VectorXd r = gradient_at_start(system);
    VectorXd z(r.size());
    return median_seconds([&] { preconditioner.apply(r, z); });
}

double v_cycle(System& system, Counters&)
{
    return apply(system, system.multigrid());
}

double cg_step(System& system, Preconditioner& preconditioner)
{
    const VectorXd x = gradient_at_start(system);
    VectorXd y(x.size()), z(x.size());
    return median_seconds(
        [&]
        {
            system.energy().total.multiply(x, y);
            preconditioner.apply(y, z);
        });
}

double cg_step(System& system, Counters&)
{
    return cg_step(system, system.multigrid());
}

double rest_factor_cg_step(System& system, Counters&)
{
    return cg_step(system, system.rest_factor());
}

double multigrid_setup(System& system, Counters& counters)
{
    counters["MB"] = 1e-6 * system.multigrid().bytes();
    system.linearise_at_rest();
    return median_seconds([&] { benchmark::DoNotOptimize(system.new_multigrid()); });
}

double rest_factor_setup(System& system, Counters& counters)
{
    counters["MB"] = 1e-6 * system.rest_factor().bytes();
    system.linearise_at_rest();
    return median_seconds(
        [&] { benchmark::DoNotOptimize(RestFactor(system.energy().total)); });
}

/// The numeric factorisation alone, of a structure that was analysed before.
double factor(System& system, Counters& counters)
{
    RestFactor& factor = system.rest_factor();
    counters["MB"] = 1e-6 * factor.bytes();
    return median_seconds([&] { factor.factorize(); });
}

double spread_setup(System& system, Counters&)
{
    return median_seconds([&] { benchmark::DoNotOptimize(system.spread()); });
}

double solve(System& system, Preconditioner& preconditioner,
             const std::vector<Pose>& start, const SolveOptions& options,
             Counters& counters)
{
    NewtonSolver solver(system.energy().total, preconditioner);
    SolveReport report;
    const double seconds = median_seconds([&] { system.energy().state.set_poses(start); },
                                          [&] { report = solver.minimize(options); });
    if (report.stop != Stop::Converged && options.max_iterations > 1)
        throw std::runtime_error(stop_name(report.stop));
    counters["newton_steps"] = report.iterations;
    counters["cg_steps"] = report.linear_steps;
    return seconds;
}

SolveOptions usual_options(System& system, Method method = Method::Newton)
{
    SolveOptions options;
    options.method = method;
    options.gradient_scale = system.gradient_scale();
    return options;
}

double newton_step(System& system, Counters& counters)
{
    SolveOptions options = usual_options(system);
    options.max_iterations = 1;
    return solve(system, system.multigrid(), system.start(), options, counters);
}

double whole_solve(System& system, Counters& counters)
{
    return solve(system, system.multigrid(), system.start(), usual_options(system),
                 counters);
}

double solve_gauss_newton(System& system, Counters& counters)
{
    return solve(system, system.multigrid(), system.start(),
                 usual_options(system, Method::GaussNewton), counters);
}

double solve_rest_factor(System& system, Counters& counters)
{
    return solve(system, system.rest_factor(), system.start(), usual_options(system),
                 counters);
}

constexpr double kDragLength = 4.0;

/// A mesh of the bar whose triangles carry more samples.
Geometry bar_geometry(std::size_t num_samples)
{
    const Shape shape = support::box_shape({0, 0, 0}, {kDragLength, 1, 1}, 8);
    Geometry geometry = scan_geometry("bar.obj", support::obj_text(shape)).geometry;
    const std::vector<Vector3d> more = support::random_points(
        shape, static_cast<int>(num_samples - geometry.samples.size()), 1);
    geometry.samples.insert(geometry.samples.end(), more.begin(), more.end());
    return geometry;
}

/// What is in the user's hand.
enum class Held
{
    Region,
    Rod,        ///< the last point of a rod in the axis, of five
    PushingRod, ///< of one that is as stiff as the bar
};

/// The bar, its lower end held and the other in the user's hand.
class DragScene
{
public:
    DragScene(int along, std::size_t num_samples, Held held) : held_(held)
    {
        const Geometry geometry = bar_geometry(num_samples);
        CellSettings cells;
        cells.across = along;
        const auto body = std::make_shared<const Body>(
            build_body(build_rest_shape(geometry, geometry.samples, cells), cells));
        const double layers = 2.0 * kDragLength / along;
        const std::string head =
            held != Held::Region
                ? std::string("rod head through 0 0.5 0.5  1 0.5 0.5  2 0.5 0.5  3 0.5 "
                              "0.5  4 0.5 0.5") +
                      (held == Held::PushingRod ? " radius 0.1 stiffness 1000" : "")
                : fmt::format("handle head box {} 0 0 {} 1 1", kDragLength - layers,
                              kDragLength);
        const HandleFile file = parse_handles(
            "bar.handles", fmt::format("cellwarp-handles 1\nfixed foot box 0 0 0 {} 1 1\n"
                                       "{}\nframe 1\n",
                                       layers, head));
        const Units units{body->rest->frame, false, bounding_box(geometry.samples),
                          body->rest->material.grid.shape().edge};
        const auto regions = std::make_shared<const RegionSet>(
            body->rest,
            resolve_regions(file.stages[0].regions, geometry, geometry.samples, units,
                            file),
            file.path);
        drag_.emplace(CellSystem(body, regions, {}), DragSettings(),
                      std::span<const SampleNormal>());
    }

    Drag& drag() { return *drag_; }
    /// A frame: what is in the hand shifted.
    DragReport frame(const std::vector<Motion>& motions)
    {
        if (held_ == Held::Region)
            return drag_->frame(motions);
        const SplineHandle& rod = *drag_->system().regions()[1].spline;
        SplineHolds holds = rod.rest_holds();
        holds.back().place += motions[1].t;
        holds.back().parts.tangent = holds.back().parts.twist = false;
        std::vector<std::shared_ptr<const SplineState>> splines =
            drag_->system().splines();
        splines[1] = rod.moved(*splines[1], holds, false);
        return drag_->frame(std::vector<Motion>(2), splines);
    }
    std::size_t num_cells() const { return drag_->system().body().cells.size(); }
    /// Once around a circle across the bar, from rest to rest.
    std::vector<std::vector<Motion>> circle(std::size_t num_frames) const
    {
        constexpr double kRadius = 0.75;
        std::vector<std::vector<Motion>> motions;
        for (std::size_t frame = 1; frame <= num_frames; ++frame)
        {
            const double angle = 2.0 * std::numbers::pi * static_cast<double>(frame) /
                                 static_cast<double>(num_frames);
            const Vector3d shift(0.0, kRadius * (std::cos(angle) - 1.0),
                                 kRadius * std::sin(angle));
            motions.push_back({{},
                               {Eigen::Matrix3d::Identity(),
                                drag_->system().rest().frame.vector_to_work(shift)}});
        }
        return motions;
    }

private:
    Held held_;
    std::optional<Drag> drag_;
};

/// The median frame of a circle, or of as much of it as there is time for.
double frame(DragScene& scene, Counters& counters)
{
    constexpr std::size_t kFrames = 200;
    constexpr double kTooLong = 12.0; // [s]
    const std::vector<std::vector<Motion>> motions = scene.circle(kFrames);
    // The first frames of a drag take their scratch from the heap.
    for (int warm = 0; warm < 2; ++warm)
        scene.frame(motions.back());
    std::vector<double> seconds, solve_ms, blend_ms;
    for (std::vector<double>* times : {&seconds, &solve_ms, &blend_ms})
        times->reserve(kFrames);
    int linear_steps = 0;
    const std::size_t allocations = support::num_allocations();
    const Clock::time_point begin = Clock::now();
    while (seconds.size() < kFrames && seconds_since(begin) < kTooLong)
    {
        const Clock::time_point start = Clock::now();
        const DragReport report = scene.frame(motions[seconds.size()]);
        seconds.push_back(seconds_since(start));
        solve_ms.push_back(report.solve_ms);
        blend_ms.push_back(report.blend_ms);
        linear_steps += report.solve.linear_steps;
    }
    const double num_frames = static_cast<double>(seconds.size());
    counters["allocations"] =
        static_cast<double>(support::num_allocations() - allocations) / num_frames;
    counters["cells"] = static_cast<double>(scene.num_cells());
    counters["cg_steps"] = linear_steps / num_frames;
    counters["frames"] = num_frames;
    counters["solve_ms"] = median(solve_ms);
    counters["blend_ms"] = median(blend_ms);
    const double worst = *std::max_element(seconds.begin(), seconds.end());
    const double middle = median(std::move(seconds));
    counters["worst_over_median"] = worst / middle;
    return middle;
}

/// Kept while its benchmarks run, and gone before the next one is made.
System& system_of(const std::string& name, const Task& task)
{
    static std::string of;
    static std::unique_ptr<System> system;
    if (of != name)
    {
        system.reset();
        system = std::make_unique<System>(task);
        of = name;
    }
    return *system;
}

/// Gives seconds.
using Measure = std::function<double(Counters&)>;

void run(benchmark::State& state, const Measure& measure)
{
    for (auto _ : state)
        try
        {
            state.SetIterationTime(measure(state.counters));
        }
        catch (const std::exception& error)
        {
            state.SkipWithError(error.what());
        }
}

void add(const std::string& name, const Measure& measure)
{
    benchmark::RegisterBenchmark(name.c_str(), [measure](benchmark::State& state)
                                 { run(state, measure); })
        ->UseManualTime()
        ->Iterations(1)
        ->Unit(benchmark::kMillisecond);
}

struct Family
{
    const char* name;
    double (*measure)(System&, Counters&);
    int most_cells;
};
/// A factor of more than that many cells takes minutes and gigabytes.
constexpr int kMostFactored = 16384;
constexpr int kAll = 207360;
const Family kFamilies[] = {
    {"linearise", linearise, kAll},
    {"multiply", multiply, kAll},
    {"spread_setup", spread_setup, kAll},
    {"multigrid_setup", multigrid_setup, kAll},
    {"v_cycle", v_cycle, kAll},
    {"cg_step", cg_step, kAll},
    {"newton_step", newton_step, kAll},
    {"solve", whole_solve, kAll},
    {"solve_gauss_newton", solve_gauss_newton, 55296},
    {"factor", factor, kMostFactored},
    {"rest_factor_setup", rest_factor_setup, kMostFactored},
    {"rest_factor_cg_step", rest_factor_cg_step, kMostFactored},
    {"solve_rest_factor", solve_rest_factor, kMostFactored},
};
constexpr int kAlong[] = {20, 32, 48, 64, 96, 160};
constexpr int kAcross[] = {5, 8, 12, 16, 24, 36};

void add_families()
{
    for (std::size_t i = 0; i < std::size(kAlong); ++i)
    {
        Task task{kAlong[i], kAcross[i]};
        task.motion = turned_about(task.on_axis(task.along), Vector3d::UnitX(), 45.0);
        for (const Family& family : kFamilies)
            if (task.num_cells() <= family.most_cells)
                add(fmt::format("{}/{}", family.name, task.num_cells()),
                    [task, &family](Counters& counters) {
                        return family.measure(
                            system_of(std::to_string(task.num_cells()), task), counters);
                    });
    }
}

void add_frames()
{
    const auto add_frame = [](const std::string& name, int along, std::size_t samples,
                              Held held = Held::Region)
    {
        add(name,
            [=](Counters& counters)
            {
                DragScene scene(along, samples, held);
                return frame(scene, counters);
            });
    };
    for (std::size_t samples = 10000; samples <= 10000000; samples *= 10)
        add_frame(fmt::format("frame/{}", samples), 32, samples);
    for (const std::size_t samples : {43000, 1000000})
        for (const auto& [name, held] : {std::pair("region", Held::Region),
                                         {"rod", Held::Rod},
                                         {"pushing_rod", Held::PushingRod}})
            add_frame(fmt::format("frame_of/{}/{}", name, samples), 32, samples, held);
    for (std::size_t i = 0; i + 1 < std::size(kAlong); ++i)
        add_frame(fmt::format("frame_cells/{}", kAlong[i] * kAcross[i] * kAcross[i]),
                  kAlong[i], 50000);
}

/// Solves from rest, without the motions spread first.
void add_cases()
{
    Task twist{32, 8}, bend = twist, fine_twist{48, 12, 3};
    twist.motion = turned_about(twist.on_axis(0), Vector3d::UnitX(), 135.0);
    fine_twist.motion = turned_about(fine_twist.on_axis(0), Vector3d::UnitX(), 135.0);
    bend.motion = turned_about(bend.on_axis(bend.along - 0.5 * bend.layers),
                               Vector3d::UnitY(), 180.0);
    for (const auto& [name, task] : {std::pair("twist_135_of_2048", twist),
                                     {"bend_180_of_2048", bend},
                                     {"twist_135_of_6912", fine_twist}})
        for (const auto& [method_name, method] :
             {std::pair("gauss_newton_direct", Method::GaussNewtonDirect),
              {"gauss_newton", Method::GaussNewton},
              {"newton", Method::Newton}})
            add(fmt::format("case/{}/{}", name, method_name),
                [name = name, task = task, method = method](Counters& counters)
                {
                    System& system = system_of(name, task);
                    SolveOptions options;
                    options.method = method;
                    options.max_iterations = 200;
                    options.gradient_tolerance = 1e-9;
                    return solve(system, system.multigrid(), system.jumped(), options,
                                 counters);
                });
}

} // namespace

int main(int argc, char** argv)
{
    benchmark::Initialize(&argc, argv);
    add_families();
    add_cases();
    add_frames();
    benchmark::RunSpecifiedBenchmarks();
}
