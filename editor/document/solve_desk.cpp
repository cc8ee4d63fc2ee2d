// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/solve_desk.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>

#include "editor/session/memory_limit.h"
#include "editor/session/scene_settings.h"
#include "editor/session/statement_chain.h"
#include "io/error.h"

namespace cellwarp
{

namespace
{

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Points of the curve of energy at the most: as many as a small plot can show.
constexpr std::size_t kCurve = 512;

/// What a request that was given up says of itself.
constexpr const char* kCancelled = "cancelled";

/// The file's end, as a place.
ScriptPlace end_of(const HandleFile& handles)
{
    return {handles.stages.size() - 1, handles.stages.back().frames.size()};
}

bool is_same_work(const SceneFile& a, const SceneFile& b)
{
    return a.across == b.across && a.max_depth == b.max_depth &&
           a.max_cells == b.max_cells && a.threshold == b.threshold && a.gap == b.gap &&
           a.thickness == b.thickness && a.energy == b.energy && a.fill == b.fill &&
           a.release == b.release && a.drag == b.drag;
}

} // namespace

struct SolveDesk::State
{
    std::shared_ptr<const GeometryFile> model;
    WorkFrame view;

    // Shared.
    mutable std::mutex mutex;
    std::condition_variable wake;
    std::optional<SolveRequest> asked;
    StatementChain asked_chain; ///< of its handles
    std::optional<Solved> solved;
    SolveStatus status;
    Clock::time_point started;
    bool is_working = false, is_stopping = false, is_cancelled = false;
    std::stop_source stop; ///< of the solve under way
    StatementChain chain;  ///< of it
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
        if (!session || !is_same_work(session_scene, request.scene))
        {
            session.reset();
            SessionSettings settings = settings_of(request.scene);
            settings.keeps_states = true;
            settings.cells.max_memory = default_memory_limit();
            settings.stop = stop.get_token();
            settings.watch = [this](const FrameProgress& now) { watch(now); };
            session.emplace(model, request.handles, settings);
            session_scene = request.scene;
        }
        else
            session->take(request.handles, stop.get_token());
        if (!session->rig())
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
            if (!session->rig())
                return false;
        }
        return true;
    }

    void describe(SolveStatus& s) const
    {
        const Rig& rig = *session->rig();
        s.report.reset();
        if (!session->frames().empty())
            s.report = session->frames().back();
        s.warnings = session->warnings();
        s.cells = rig.body().cells.size();
        s.free_cells = 0;
        s.cells_per_depth.clear();
        for (std::size_t c = 0; c < s.cells; ++c)
        {
            const std::size_t leaf =
                static_cast<std::size_t>(rig.body().cells.cells[c].leaf);
            const std::size_t level =
                static_cast<std::size_t>(rig.body().octree.leaves()[leaf].level);
            if (s.cells_per_depth.size() <= level)
                s.cells_per_depth.resize(level + 1, 0);
            ++s.cells_per_depth[level];
            s.free_cells += rig.region_of_cell()[c] < 0;
        }
        s.across = rig.rest().across;
        s.inside = inside_name(rig.rest().material.method);
        s.diagonal = rig.rest().frame.length_to_model(rig.rest().frame.diagonal());
        s.energy = rig.energy();
        s.max_gap = rig.largest_gap();
        const Field* const now = session->field();
        s.centres = now ? now->parts().num_centres : 0;
        s.clusters = now ? now->num_clusters() : 0;
    }

    Solved result_of(const SolveRequest& request) const
    {
        const Rig& rig = *session->rig();
        Solved out;
        out.revision = request.revision;
        out.patch = std::make_shared<const Patch>(session->patch());
        out.shape = shown_at(model->geometry, out.patch->samples, request.layout, view);
        out.cells = shown_cells(rig, rig.poses(), view);
        out.rest =
            std::make_shared<const std::vector<Eigen::Vector3d>>(session->rest_samples());
        out.stage_print = session->stage_print();
        const auto& regions = rig.regions().regions();
        const SessionSettings preview = settings_of(request.scene, true);
        if (std::any_of(regions.begin(), regions.end(),
                        [](const Region& region) {
                            return region.role == Role::Handle ||
                                   region.role == Role::Pin;
                        }))
            out.drag.emplace(
                DragSource{model,
                           out.rest,
                           rig.shared_body(),
                           rig.shared_regions(),
                           rig.state(),
                           session->recutting(),
                           {default_memory_limit(), preview.method, preview.departures},
                           preview.field.kind,
                           view,
                           session->stage_print()});
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

SolveDesk::SolveDesk(std::shared_ptr<const GeometryFile> model, const WorkFrame& view)
    : state_(std::make_unique<State>(std::move(model), view))
{
}

SolveDesk::~SolveDesk()
{
    {
        const std::lock_guard lock(state_->mutex);
        state_->is_stopping = true;
        state_->stop.request_stop();
    }
    state_->wake.notify_all();
    state_->thread.join();
}

void SolveDesk::ask(SolveRequest request)
{
    StatementChain chain(request.handles);
    {
        const std::lock_guard lock(state_->mutex);
        const auto goes_on = [&]
        {
            return chain.has(state_->end) &&
                   chain.up_to(state_->end) == state_->chain.up_to(state_->end) &&
                   is_same_work(request.scene, state_->scene);
        };
        if (state_->is_working && !goes_on())
            state_->stop.request_stop();
        state_->asked = std::move(request);
        state_->asked_chain = std::move(chain);
    }
    state_->wake.notify_all();
}

void SolveDesk::cancel()
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

std::optional<Solved> SolveDesk::take()
{
    const std::lock_guard lock(state_->mutex);
    return std::exchange(state_->solved, std::nullopt);
}

SolveStatus SolveDesk::status() const
{
    const std::lock_guard lock(state_->mutex);
    SolveStatus status = state_->status;
    if (state_->is_working)
        status.seconds = seconds_since(state_->started);
    return status;
}

bool SolveDesk::is_busy() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->is_working || state_->asked;
}

} // namespace cellwarp
