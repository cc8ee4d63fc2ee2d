// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/solve_worker.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>

#include "editor/session/memory_limit.h"
#include "editor/session/scene_settings.h"
#include "editor/session/script_fingerprint.h"
#include "io/error.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

/// Points of the curve of energy at the most: as many as a small plot can show.
constexpr std::size_t kCurve = 512;

/// What a request that was given up says of itself.
constexpr const char* kCancelled = "cancelled";

/// The file's end, as a place.
ScriptPlace end_of(const HandleFile& handles)
{
    return {handles.stages.size() - 1, handles.stages.back().frames.size()};
}

} // namespace

struct SolveWorker::State
{
    std::shared_ptr<const GeometryFile> model;
    WorkFrame view;

    // Shared.
    mutable std::mutex mutex;
    std::condition_variable wake;
    std::optional<SolveRequest> asked;
    ScriptFingerprint asked_chain; ///< of its handles
    std::optional<Solved> solved;
    SolveStatus status;
    Clock::time_point started;
    bool is_working = false, is_stopping = false, is_cancelled = false;
    std::stop_source stop;   ///< of the solve under way
    ScriptFingerprint chain; ///< of it
    ScriptPlace end;
    SceneFile scene;

    // Of the thread.
    std::optional<Session> session;
    SceneFile session_scene;

    std::jthread thread;

    State(std::shared_ptr<const GeometryFile> of, const WorkFrame& in)
        : model(std::move(of)), view(in)
    {
        thread = std::jthread([this] { run(); });
    }

    template <class Change>
    void tell(Change&& change)
    {
        const std::lock_guard lock(mutex);
        change(status);
    }

    bool next_request(SolveRequest& request)
    {
        std::unique_lock lock(mutex);
        is_working = false;
        wake.wait(lock, [&] { return is_stopping || asked; });
        if (is_stopping)
            return false;
        request = std::move(*asked);
        asked.reset();
        is_working = true;
        is_cancelled = false;
        stop = std::stop_source();
        chain = std::move(asked_chain);
        end = end_of(request.handles);
        scene = request.scene;
        started = Clock::now();
        status.state = SolveStatus::State::Preparing;
        status.error.clear();
        status.error_region.clear();
        status.energy_curve.clear();
        status.frames_to_do = 0;
        return true;
    }

    void watch(const FrameProgress& now)
    {
        const std::lock_guard lock(mutex);
        status.progress = now;
        status.state = SolveStatus::State::Solving;
        std::vector<std::pair<double, double>>& curve = status.energy_curve;
        if (curve.size() >= kCurve) // every second one
        {
            for (std::size_t k = 0; 2 * k < curve.size(); ++k)
                curve[k] = curve[2 * k];
            curve.resize(curve.size() / 2);
        }
        curve.emplace_back(seconds_since(started), now.energy);
    }

    /// Brings the session to the statements; false if it was stopped on the way.
    bool solve(const SolveRequest& request)
    {
        if (!session || session_scene.settings != request.scene.settings)
        {
            session.reset();
            SessionSettings settings = settings_of(request.scene);
            settings.keeps_checkpoints = true;
            settings.cells.max_memory = default_memory_limit();
            settings.stop = stop.get_token();
            settings.watch = [this](const FrameProgress& now) { watch(now); };
            session.emplace(geometry_of(model), request.handles, settings);
            session_scene = request.scene;
        }
        else
            session->set_script(request.handles, stop.get_token());
        if (!session->system())
            return false;
        tell(
            [&](SolveStatus& s)
            {
                s.frames_to_do = session->num_upcoming();
                s.frames_before = 0;
                for (const Stage& stage : request.handles.stages)
                    s.frames_before += stage.frames.size();
                s.frames_before -= s.frames_to_do;
            });
        for (std::size_t left = session->num_upcoming(); left > 0; --left)
        {
            session->next_frame(left == 1);
            if (!session->system())
                return false;
        }
        return true;
    }

    void describe(SolveStatus& s) const
    {
        const CellSystem& system = *session->system();
        s.report.reset();
        if (!session->frames().empty())
            s.report = session->frames().back();
        s.warnings = session->warnings();
        s.cells = system.body().cells.size();
        s.free_cells = 0;
        s.cells_per_depth.clear();
        for (std::size_t c = 0; c < s.cells; ++c)
        {
            const std::size_t leaf = idx(system.body().cells.cells[c].leaf);
            const std::size_t level = idx(system.body().octree.leaves()[leaf].level);
            if (s.cells_per_depth.size() <= level)
                s.cells_per_depth.resize(level + 1, 0);
            ++s.cells_per_depth[level];
            s.free_cells += system.region_of_cell()[c] < 0;
        }
        s.across = system.rest().across;
        s.inside = inside_name(system.rest().material.method);
        s.diagonal = system.rest().frame.length_to_model(system.rest().frame.diagonal());
        s.energy = system.energy();
        s.max_gap = system.largest_gap();
        const Field* const now = session->field();
        s.centres = now ? now->parts().num_centres : 0;
        s.clusters = now ? now->num_clusters() : 0;
    }

    Solved result_of(const SolveRequest& request) const
    {
        const CellSystem& system = *session->system();
        Solved out;
        out.revision = request.revision;
        out.patch = std::make_shared<const DeformedSamples>(session->deformed());
        out.shape = shown_at(model->geometry, out.patch->samples, request.layout, view);
        out.cells = shown_cells(system, system.poses(), view);
        out.rest =
            std::make_shared<const std::vector<Eigen::Vector3d>>(session->rest_samples());
        out.stage_fingerprint = session->stage_fingerprint();
        const auto& regions = system.regions().regions();
        const SessionSettings preview = settings_of(request.scene, true);
        if (std::any_of(regions.begin(), regions.end(),
                        [](const Region& region) {
                            return region.role == Role::Handle ||
                                   region.role == Role::Pin;
                        }))
            out.drag.emplace(
                DragSource{model,
                           out.rest,
                           system.shared_body(),
                           system.shared_regions(),
                           system.state(),
                           session->refiner(),
                           {default_memory_limit(), preview.method, preview.departures},
                           preview.field.kind,
                           view,
                           session->stage_fingerprint()});
        return out;
    }

    void fail(const SolveRequest& request, const std::string& what)
    {
        // As errors name a field: "FILE:LINE: REGION: ...", or without a file.
        std::string region;
        for (const RegionStatement& statement : request.handles.stages.back().regions)
            if (what.starts_with(statement.name + ": ") ||
                what.find(" " + statement.name + ": ") != std::string::npos)
                region = statement.name;
        const std::lock_guard lock(mutex);
        status.state = SolveStatus::State::Failed;
        status.error = what;
        status.error_region = region;
        status.seconds = seconds_since(started);
        status.warnings.clear();
    }

    void work_on(const SolveRequest& request)
    {
        try
        {
            if (!solve(request))
            {
                const std::lock_guard lock(mutex);
                if (!is_cancelled)
                    return; // another request is there
                status.state = SolveStatus::State::Failed;
                status.error = kCancelled;
                return;
            }
            tell([](SolveStatus& s) { s.state = SolveStatus::State::Field; });
            Solved out = result_of(request);
            SolveStatus done;
            tell([&](SolveStatus& s) { done = s; });
            describe(done); // takes a while: whoever asks for the status does not wait
            done.state = SolveStatus::State::Idle;
            done.seconds = seconds_since(started);
            const std::lock_guard lock(mutex);
            if (is_cancelled) // it may be another request that was waiting
            {
                status.state = SolveStatus::State::Failed;
                status.error = kCancelled;
                return;
            }
            solved = std::move(out);
            status = std::move(done);
        }
        catch (const Error& error)
        {
            fail(request, error.what());
        }
        catch (const std::bad_alloc&)
        {
            session.reset();
            fail(request, "out of memory: fewer cells need less");
        }
        catch (const std::exception& error)
        {
            session.reset();
            fail(request, std::string("internal error: ") + error.what());
        }
    }

    void run()
    {
        // Nothing of a request is kept when it is done.
        for (SolveRequest request; next_request(request); request = {})
            try
            {
                work_on(request);
            }
            catch (const std::exception&) // not even memory to say what was wrong
            {
                session.reset();
                tell(
                    [](SolveStatus& s)
                    {
                        s.state = SolveStatus::State::Failed;
                        s.error.clear();
                    });
            }
    }
};

SolveWorker::SolveWorker(std::shared_ptr<const GeometryFile> model, const WorkFrame& view)
    : state_(std::make_unique<State>(std::move(model), view))
{
}

SolveWorker::~SolveWorker()
{
    {
        const std::lock_guard lock(state_->mutex);
        state_->is_stopping = true;
        state_->stop.request_stop();
    }
    state_->wake.notify_all();
    state_->thread.join();
}

void SolveWorker::ask(SolveRequest request)
{
    ScriptFingerprint chain(request.handles);
    {
        const std::lock_guard lock(state_->mutex);
        const auto goes_on = [&]
        {
            return chain.has(state_->end) &&
                   chain.up_to(state_->end) == state_->chain.up_to(state_->end) &&
                   request.scene.settings == state_->scene.settings;
        };
        if (state_->is_working && !goes_on())
            state_->stop.request_stop();
        state_->asked = std::move(request);
        state_->asked_chain = std::move(chain);
    }
    state_->wake.notify_all();
}

void SolveWorker::cancel()
{
    const std::lock_guard lock(state_->mutex);
    if (state_->asked && !state_->is_working) // it has not begun
    {
        state_->status.state = SolveStatus::State::Failed;
        state_->status.error = kCancelled;
    }
    state_->asked.reset();
    state_->is_cancelled = true;
    state_->stop.request_stop();
}

std::optional<Solved> SolveWorker::take()
{
    const std::lock_guard lock(state_->mutex);
    return std::exchange(state_->solved, std::nullopt);
}

SolveStatus SolveWorker::status() const
{
    const std::lock_guard lock(state_->mutex);
    SolveStatus status = state_->status;
    if (state_->is_working)
        status.seconds = seconds_since(state_->started);
    return status;
}

bool SolveWorker::is_busy() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->is_working || state_->asked;
}

} // namespace cellwarp
