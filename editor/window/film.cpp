// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/film.h"

#include <filesystem>
#include <mutex>
#include <new>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "io/base/error.h"
#include "library/session/memory_limit.h"
#include "library/session/scene_settings.h"
#include "octree/base/index.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

/// What frames may take together [byte].
constexpr double kMostBytes = 2e9;

/// Kept as it is written; what is drawn of it is made when it is looked at.
struct MadeFrame
{
    std::shared_ptr<const DeformedSamples> deformed;
    std::vector<ShownLine> lines;
};

double bytes_of(const DeformedSamples& deformed)
{
    return sizeof(double) *
           static_cast<double>(3 * (deformed.samples.size() + deformed.directions.size() +
                                    deformed.tangents.size()) +
                               4 * deformed.rotations.size());
}

/// Skeleton and rods as lines.
std::vector<ShownLine> lines_of(const Simulation& simulation, const WorkFrame& view)
{
    constexpr int kPlaces = 65; // of a rod
    std::vector<ShownLine> lines;
    if (simulation.flesh())
        lines = shown_joints(simulation.flesh()->joints(), view);
    if (!simulation.objects())
        return lines;
    for (const SimulatedRod& rod : simulation.objects()->rods(kPlaces))
    {
        ShownLine& line = lines.emplace_back();
        line.name = rod.name;
        for (const Eigen::Vector3d& place : rod.curve)
            line.places.push_back(view.to_work(place / simulation.unit()));
    }
    return lines;
}

} // namespace

SimulationInput played_input(std::shared_ptr<const GeometryFile> model,
                             const HandleFile& handles, const SceneFile& scene)
{
    SimulationInput input{scene, std::move(model), handles, settings_of(scene)};
    input.settings.cells.max_memory = default_memory_limit();
    return input;
}

struct Film::State
{
    std::shared_ptr<const GeometryFile> model;
    HandleFile handles;
    SceneFile scene;
    WorkFrame view;

    mutable std::mutex mutex;                  ///< of what follows
    std::shared_ptr<const ShapeLayout> layout; ///< of all frames
    std::vector<MadeFrame> frames;
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

    void make()
    {
        Simulation simulation(played_input(model, handles, scene));
        // An equilibrium has the start, and its rest.
        const std::int64_t last_frame =
            simulation.is_static() ? 1 : simulation.last_frame();
        std::shared_ptr<const ShapeLayout> own_layout = layout_of(model->geometry);
        double bytes = 0.0;
        const auto add = [&]
        {
            MadeFrame made{std::make_shared<const DeformedSamples>(simulation.deformed()),
                           lines_of(simulation, view)};
            bytes += bytes_of(*made.deformed);
            tell([&] { frames.push_back(std::move(made)); });
        };
        tell(
            [&]
            {
                layout = std::move(own_layout);
                last = last_frame;
                seconds = simulation.time().dt *
                          static_cast<double>(simulation.time().steps_a_frame());
            });
        add();
        for (std::int64_t frame = 1; frame <= last_frame; ++frame)
        {
            check_stop();
            if (bytes > kMostBytes)
                throw Error(Fault::Budget,
                            fmt::format("frames 0 to {} are all that fit in {:.0f} GB: "
                                        "the others are for cellwarp simulate",
                                        frame - 1, 1e-9 * kMostBytes));
            simulation.next_frame();
            const std::vector<std::string> problems = simulation.report().problems;
            check_stop();
            if (!problems.empty())
                tell([&]
                     { error = fmt::format("frame {}, {}", frame, problems.front()); });
            add();
        }
    }

    void run(const std::stop_token& stop)
    {
        std::string what;
        const StopOnRequest scope(stop);
        try
        {
            make();
        }
        catch (const Stopped&)
        {
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
    const SceneFile& scene = document.scene();
    return scene.has_flesh() || scene.time.carries();
}

std::string Film::poses_of(const Document& document)
{
    const SceneFile scene = document.scene();
    if (!scene.has_flesh())
        return "";
    // Without keys the frames are what is played.
    const std::size_t own =
        document.has_keys_of_scene() ? document.num_frames_without_key() : 0;
    return "the poses of " + std::filesystem::path(scene.path).filename().string() +
           (own == 0   ? ""
            : own == 1 ? ", without the one made here"
                       : fmt::format(", without the {} made here", own));
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
    MadeFrame made;
    std::shared_ptr<const ShapeLayout> layout;
    {
        const std::lock_guard lock(state_->mutex);
        made = state_->frames[idx(frame)];
        layout = state_->layout;
    }
    auto shape = std::make_shared<ShownShape>(shown_at(state_->model->geometry,
                                                       made.deformed->samples,
                                                       std::move(layout), state_->view));
    shape->lines = std::move(made.lines);
    return shape;
}

std::shared_ptr<const DeformedSamples> Film::deformed(std::int64_t frame) const
{
    const std::lock_guard lock(state_->mutex);
    return state_->frames[idx(frame)].deformed;
}

} // namespace cellwarp::core
