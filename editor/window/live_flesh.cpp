// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/live_flesh.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>
#include <new>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "editor/window/film.h"
#include "octree/base/clock.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

struct LiveFlesh::State
{
    std::shared_ptr<const GeometryFile> model;
    HandleFile handles;
    SceneFile scene;
    WorkFrame view;

    mutable std::mutex mutex; ///< of what follows
    std::shared_ptr<const ShownShape> newest;
    double time = 0.0;
    std::string error;
    /// The joint in the hand, and where it is to be [model unit].
    std::optional<std::pair<std::string, Eigen::Vector3d>> pulled;
    std::optional<FleshPull> pulled_flesh;

    std::jthread thread; ///< ends first

    /// The joint that the hand has is led there; others stay where it left them.
    void lead(FleshSimulation& simulation, std::map<std::string, Move>& by_hand) const
    {
        std::optional<std::pair<std::string, Eigen::Vector3d>> now;
        {
            const std::lock_guard lock(mutex);
            now = pulled;
            simulation.pull(pulled_flesh);
        }
        if (!now)
            return;
        if (const std::optional<Move> move = simulation.pointed(now->first, now->second))
            by_hand[move->region] = *move;
        std::vector<Move> moves;
        for (const auto& [joint, move] : by_hand)
            moves.push_back(move);
        simulation.lead(std::move(moves));
    }

    void play(const std::stop_token& stop)
    {
        Simulation played(played_input(model, handles, scene));
        FleshSimulation& simulation = *played.flesh();
        const Geometry& geometry = model->geometry;
        const std::shared_ptr<const ShapeLayout> layout = layout_of(geometry);
        const auto show = [&]
        {
            auto shape = std::make_shared<ShownShape>(
                shown_at(geometry, simulation.deformed_live().samples, layout, view));
            shape->lines = shown_joints(simulation.joints(), view);
            const std::lock_guard lock(mutex);
            newest = std::move(shape);
            time = static_cast<double>(simulation.steps_done()) * simulation.time().dt;
        };
        show();
        std::map<std::string, Move> by_hand;
        const Clock::time_point begin = Clock::now();
        double lost = 0.0; // where steps take longer than their time [s]
        while (!stop.stop_requested())
        {
            for (std::int64_t k = 0; k < simulation.steps_a_frame(); ++k)
            {
                lead(simulation, by_hand);
                played.step();
                if (!simulation.is_finite())
                    throw std::runtime_error(fmt::format(
                        "the flesh has no finite numbers after {:.3f} s: a smaller dt "
                        "may help",
                        static_cast<double>(simulation.steps_done()) *
                            simulation.time().dt));
            }
            show();
            const double due = lost + static_cast<double>(simulation.steps_done()) *
                                          simulation.time().dt;
            const double now = seconds_since(begin);
            lost += std::max(0.0, now - due);
            if (now < due)
                std::this_thread::sleep_for(std::chrono::duration<double>(due - now));
        }
    }

    void run(const std::stop_token& stop)
    {
        std::string what;
        const StopOnRequest scope(stop);
        try
        {
            play(stop);
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
        const std::lock_guard lock(mutex);
        error = what;
    }
};

LiveFlesh::LiveFlesh(const Editing& editing) : state_(std::make_unique<State>())
{
    State& s = *state_;
    const Document& document = editing.document();
    s.model = document.model();
    s.handles = document.handles();
    s.scene = document.scene();
    s.view = editing.view_frame();
    s.thread = std::jthread([&s](const std::stop_token& stop) { s.run(stop); });
}

LiveFlesh::~LiveFlesh() = default;

std::shared_ptr<const ShownShape> LiveFlesh::newest() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->newest;
}

double LiveFlesh::time() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->time;
}

std::string LiveFlesh::error() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->error;
}

void LiveFlesh::pull(const std::string& joint, const Eigen::Vector3d& place)
{
    const Eigen::Vector3d model = state_->view.to_model(place);
    const std::lock_guard lock(state_->mutex);
    state_->pulled.emplace(joint, model);
}

void LiveFlesh::pull(std::uint32_t sample, const Eigen::Vector3d& place)
{
    const Eigen::Vector3d model = state_->view.to_model(place);
    const std::lock_guard lock(state_->mutex);
    state_->pulled_flesh = FleshPull{sample, model};
}

void LiveFlesh::let_go()
{
    const std::lock_guard lock(state_->mutex);
    state_->pulled.reset();
    state_->pulled_flesh.reset();
}

} // namespace cellwarp::core
