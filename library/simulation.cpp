// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/simulation.h>

#include <algorithm>
#include <atomic>

#include "io/base/error.h"
#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/time/simulation.h"

namespace cellwarp
{

struct Simulation::State
{
    explicit State(const core::SceneFile& scene) : path(scene.path), simulation(of(scene))
    {
    }
    static core::SimulationInput of(const core::SceneFile& scene)
    {
        if (!scene.is_in_time())
            throw core::Error(
                core::Fault::Usage,
                core::at({scene.path, 0, scene.is_simulated ? "rods" : "simulate"},
                         "is missing: there is nothing to simulate"));
        return read_simulation(scene);
    }

    std::string path;
    core::Simulation simulation;
    std::int64_t frame = 0;
    MotionReport report;
    bool has_ended = false; ///< by an error
    mutable std::atomic_flag busy;

    std::int64_t last_frame() const
    {
        return simulation.is_static() ? 1 : simulation.last_frame();
    }
    double time() const
    {
        return simulation.is_static() ? 0.0 : simulation.time().time_of(frame);
    }
    void measure();
    const core::ObjectSimulation& objects() const
    {
        if (!simulation.objects())
            throw Error(Fault::Usage, "the scene has flesh alone");
        return *simulation.objects();
    }
    core::FleshSimulation& flesh()
    {
        if (!simulation.flesh())
            throw Error(Fault::Usage, "the scene has no flesh");
        return *simulation.flesh();
    }
    template <class Work>
    auto look(Work&& work) const
    {
        return run_call(
            [&]
            {
                const OneThread alone(busy);
                return work();
            });
    }
};

namespace
{

void check_count(const char* name, int count, int low, int high)
{
    if (count < low || count > high)
        throw wrong_argument(name, "got " + std::to_string(count) + ", need " +
                                       std::to_string(low) + " to " +
                                       std::to_string(high));
}

std::vector<double> listed(const std::vector<Eigen::Vector3d>& places)
{
    const std::span<const double> numbers = numbers_of(places);
    return {numbers.begin(), numbers.end()};
}

} // namespace

void Simulation::State::measure()
{
    const core::SimulationReport of = simulation.report();
    report = {};
    report.frame = frame;
    report.time = of.time;
    report.kinetic = of.kinetic;
    report.elastic = of.elastic;
    report.gravity = of.gravity;
    report.momentum = from_eigen(of.momentum);
    report.angular_momentum = from_eigen(of.angular_momentum);
    report.violation = of.violation;
    report.iterations = of.iterations;
    report.contacts = of.contacts;
    if (of.flesh)
    {
        report.support = from_eigen(of.flesh->support);
        report.pull = from_eigen(of.flesh->pull);
        report.largest_strain = of.flesh->largest_strain;
        report.inverted = of.flesh->inverted;
        report.step_ms = of.flesh->step_ms;
    }
    report.stop = of.stop;
    report.problems = of.problems;
    report.is_converged = of.is_converged && of.problems.empty();
}

Simulation::Simulation(std::unique_ptr<State> state) : state_(std::move(state)) {}
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;
Simulation::~Simulation() = default;

Simulation Simulation::read(const std::string& path, const Control& control)
{
    return run_call(control, 0,
                    [&](Watcher& watcher)
                    {
                        watcher.begin("read", 0.0);
                        auto state = std::make_unique<State>(core::read_scene(path));
                        state->measure();
                        return Simulation(std::move(state));
                    });
}

Simulation Simulation::parse(std::string_view scene, const std::string& folder,
                             const Control& control)
{
    return run_call(control, 0,
                    [&](Watcher& watcher)
                    {
                        watcher.begin("read", 0.0);
                        auto state = std::make_unique<State>(
                            core::parse_scene(folder + "/scene", std::string(scene)));
                        state->measure();
                        return Simulation(std::move(state));
                    });
}

std::int64_t Simulation::frame() const
{
    return state_->frame;
}

std::int64_t Simulation::last_frame() const
{
    return state_->last_frame();
}

double Simulation::time() const
{
    return state_->time();
}

double Simulation::unit() const
{
    return state_->simulation.unit();
}

std::vector<std::string> Simulation::warnings() const
{
    return state_->look([&] { return state_->simulation.warnings(); });
}

bool Simulation::next(bool wants_samples, const Control& control)
{
    return run_call(
        control, 0,
        [&](Watcher& watcher)
        {
            const OneThread alone(state_->busy);
            if (state_->has_ended)
                throw Error(Fault::Usage, "the simulation has ended with an error");
            if (state_->frame >= state_->last_frame())
                return false;
            watcher.begin("step", 0.0);
            core::Simulation& simulation = state_->simulation;
            const std::int64_t before = simulation.steps_done();
            const std::int64_t steps = std::max<std::int64_t>(
                simulation.is_static() ? 1 : simulation.time().steps_a_frame(), 1);
            watcher.progress().all = static_cast<std::size_t>(steps);
            state_->has_ended = true;
            simulation.next_frame(
                [&]
                {
                    const std::int64_t done = simulation.steps_done() - before;
                    watcher.progress().done = static_cast<std::size_t>(done);
                    watcher.set_share(static_cast<double>(done) /
                                      static_cast<double>(steps));
                    watcher.show();
                    core::check_stop();
                },
                wants_samples);
            ++state_->frame;
            state_->measure();
            state_->has_ended = false;
            return true;
        });
}

const MotionReport& Simulation::report() const
{
    return state_->report;
}

std::optional<Model> Simulation::model() const
{
    if (!state_->simulation.model())
        return std::nullopt;
    return Access::model(state_->simulation.model());
}

Deformed Simulation::deformed()
{
    return state_->look(
        [&]
        {
            if (!state_->simulation.model())
                throw Error(Fault::Usage, "the scene has no model");
            return Access::deformed(std::make_shared<const core::DeformedSamples>(
                state_->simulation.deformed()));
        });
}

std::vector<MovingRod> Simulation::rods(int places) const
{
    return state_->look(
        [&]
        {
            constexpr int kMost = 10000;
            check_count("places", places, 2, kMost);
            std::vector<MovingRod> out;
            if (state_->simulation.objects())
                for (const core::SimulatedRod& rod : state_->objects().rods(places))
                    out.push_back({rod.name, rod.length, listed(rod.curve), rod.sliding});
            return out;
        });
}

std::vector<MovingBody> Simulation::bodies() const
{
    return state_->look(
        [&]
        {
            std::vector<MovingBody> out;
            if (state_->simulation.objects())
                for (const core::SimulatedBody& body : state_->objects().bodies())
                {
                    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
                    pose.topLeftCorner<3, 3>() = body.R;
                    pose.topRightCorner<3, 1>() = body.at;
                    out.push_back({body.name, from_eigen(pose)});
                }
            return out;
        });
}

std::vector<MovingNet> Simulation::nets() const
{
    return state_->look(
        [&]
        {
            std::vector<MovingNet> out;
            if (state_->simulation.objects())
                for (const core::SimulatedNet& net : state_->objects().nets())
                    out.push_back({net.name, listed(net.points)});
            return out;
        });
}

std::vector<MovingSheet> Simulation::sheets(int places) const
{
    return state_->look(
        [&]
        {
            constexpr int kMost = 1000;
            check_count("places", places, 2, kMost);
            std::vector<MovingSheet> out;
            if (state_->simulation.objects())
                for (const core::SimulatedSheet& sheet : state_->objects().sheets(places))
                    out.push_back({sheet.name, listed(sheet.points)});
            return out;
        });
}

std::vector<PosedJoint> Simulation::joints() const
{
    return state_->look(
        [&]
        {
            return state_->simulation.flesh()
                       ? from_core(state_->simulation.flesh()->joints())
                       : std::vector<PosedJoint>();
        });
}

Model Simulation::surface(int around) const
{
    return state_->look(
        [&]
        {
            constexpr int kFewest = 3, kMost = 1000;
            check_count("around", around, kFewest, kMost);
            auto file = std::make_shared<core::GeometryFile>();
            file->geometry = state_->objects().surface(around);
            return Access::model(std::move(file));
        });
}

void Simulation::pull(std::size_t sample, Vec3 place)
{
    state_->look(
        [&]
        {
            core::FleshSimulation& flesh = state_->flesh();
            if (sample >= flesh.geometry().samples.size())
                throw wrong_argument("sample",
                                     "got " + std::to_string(sample) + ", there are " +
                                         std::to_string(flesh.geometry().samples.size()));
            if (!to_eigen(place).allFinite())
                throw wrong_argument("place", "it is not finite");
            flesh.pull(core::FleshPull{sample, to_eigen(place)});
        });
}

void Simulation::let_go()
{
    state_->look([&] { state_->flesh().pull(std::nullopt); });
}

} // namespace cellwarp
