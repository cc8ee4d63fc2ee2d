// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/film.h"

#include <mutex>
#include <new>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "editor/session/memory_limit.h"
#include "editor/session/scene_settings.h"
#include "editor/simulation/carried_model.h"
#include "io/error.h"
#include "io/rod_scene.h"
#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

/// What frames may take together [byte].
constexpr double kMostBytes = 2e9;

/// Of the lines of rods.
constexpr int kPlacesOfLine = 65;

double bytes_of(const ShownShape& shape)
{
    return sizeof(float) *
           static_cast<double>(shape.positions.size() + shape.normals.size());
}

} // namespace

struct Film::State
{
    std::shared_ptr<const GeometryFile> model;
    HandleFile handles;
    SceneFile scene;
    WorkFrame view;

    mutable std::mutex mutex; ///< of what follows
    std::vector<std::shared_ptr<const ShownShape>> frames;
    std::int64_t last = -1;
    double seconds = 1.0 / 30.0;
    std::string error;
    bool is_working = true;

    std::jthread thread; ///< ends first

    template <class Change>
    void tell(Change&& change)
    {
        const std::lock_guard lock(mutex);
        change();
    }

    ShownShape shown(const std::vector<Eigen::Vector3d>& samples,
                     const std::shared_ptr<const ShapeLayout>& layout,
                     const Simulation& simulation, double unit) const
    {
        ShownShape shape = shown_at(model->geometry, samples, layout, view);
        for (const SimulatedRod& rod : simulation.rods(kPlacesOfLine))
        {
            ShownLine& line = shape.lines.emplace_back();
            line.name = rod.name;
            for (const Eigen::Vector3d& place : rod.curve)
                line.places.push_back(view.to_work(place / unit));
        }
        return shape;
    }

    void make(const std::stop_token& stop)
    {
        const RodScene rods = parse_rod_scene(scene.path, scene.text);
        Simulation simulation(rods);
        SessionSettings settings = settings_of(scene);
        settings.cells.max_memory = default_memory_limit();
        settings.stop = stop;
        CarriedModel carried(geometry_of(model), handles, settings, rods.unit,
                             simulation);
        const std::shared_ptr<const ShapeLayout> layout = layout_of(model->geometry);
        const std::int64_t count = simulation.is_static() ? 1 : simulation.last_frame();
        double bytes = 0.0;
        const auto add = [&](const std::vector<Eigen::Vector3d>& samples)
        {
            auto shape = std::make_shared<const ShownShape>(
                shown(samples, layout, simulation, rods.unit));
            bytes += bytes_of(*shape);
            tell([&] { frames.push_back(std::move(shape)); });
        };
        tell(
            [&]
            {
                last = count;
                seconds = rods.dt * static_cast<double>(simulation.steps_a_frame());
            });
        add(model->geometry.samples);
        for (std::int64_t frame = 1; frame <= count && !stop.stop_requested(); ++frame)
        {
            if (bytes > kMostBytes)
                throw Error(Fault::Budget,
                            fmt::format("frames 0 to {} are all that fit in {:.0f} GB: "
                                        "the others are for cellwarp simulate",
                                        frame - 1, 1e-9 * kMostBytes));
            simulation.next_frame();
            carried.follow(simulation, true);
            if (stop.stop_requested())
                return;
            const SimulationReport report = simulation.report();
            const SolveReport& cells = carried.session().frames().back().solve;
            if (!report.is_converged || cells.stop != Stop::Converged)
                tell(
                    [&]
                    {
                        error = fmt::format("frame {} did not converge ({})", frame,
                                            report.is_converged ? stop_name(cells.stop)
                                                                : report.stop);
                    });
            add(carried.session().deformed().samples);
        }
    }

    void run(const std::stop_token& stop)
    {
        std::string what;
        try
        {
            make(stop);
        }
        catch (const std::bad_alloc&)
        {
            what = "out of memory";
        }
        catch (const std::exception& fault)
        {
            what = fault.what();
        }
        tell(
            [&]
            {
                if (!what.empty())
                    error = what;
                is_working = false;
            });
    }
};

bool Film::is_in(const Document& document)
{
    return document.scene().has_carriers;
}

Film::Film(const Editing& editing) : state_(std::make_unique<State>())
{
    State& s = *state_;
    const Document& document = editing.document();
    s.model = document.model();
    s.handles = document.handles();
    s.scene = document.scene();
    s.view = editing.view_frame();
    s.thread = std::jthread([&s](const std::stop_token& stop) { s.run(stop); });
}

Film::~Film() = default;

std::int64_t Film::num_made() const
{
    const std::lock_guard lock(state_->mutex);
    return static_cast<std::int64_t>(state_->frames.size());
}

std::int64_t Film::last() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->last;
}

double Film::seconds_a_frame() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->seconds;
}

bool Film::is_working() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->is_working;
}

std::string Film::error() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->error;
}

std::shared_ptr<const ShownShape> Film::shape(std::int64_t frame) const
{
    const std::lock_guard lock(state_->mutex);
    return state_->frames[idx(frame)];
}

} // namespace cellwarp
