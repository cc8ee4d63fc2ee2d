// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/solve_worker.h"

#include <algorithm>
#include <stop_token>

#include "io/base/error.h"
#include "library/session/default_plane.h"
#include "library/session/large_heap.h"
#include "library/session/memory_limit.h"
#include "library/session/scene_settings.h"
#include "library/session/script_fingerprint.h"
#include "library/session/worker.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

/// Points of the curve of energy at the most: as many as a small plot can show.
constexpr std::size_t kCurve = 512;

/// Memory of models with more samples goes back to the system after each solve.
constexpr std::size_t kFreesAbove = 250'000;

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
    SolveStatus status;
    Clock::time_point started;
    bool is_cancelled = false;
    std::stop_source stop;                  ///< of the solve under way
    bool is_making_shape = false;           ///< which serves other statements as well
    ScriptFingerprint asked_script, script; ///< of the request that waits; of it
    ScriptPlace end;
    SceneFile scene;

    // Of the thread.
    std::optional<Session> session;
    std::shared_ptr<const RestShape> shape; ///< of the model, until it is in the session
    SceneFile session_scene;                ///< of both
    /// The rest places of the stage with this fingerprint; its results share them.
    std::shared_ptr<const std::vector<Eigen::Vector3d>> rest;
    std::uint64_t rest_fingerprint = 0;

    Worker<SolveRequest, Solved> worker;

    State(std::shared_ptr<const GeometryFile> of, const WorkFrame& in)
        : model(std::move(of)), view(in)
    {
        worker.start([this] { run(); });
    }

    template <class Change>
    void tell(Change&& change)
    {
        worker.alone([&] { change(status); });
    }

    void begin(const SolveRequest& request)
    {
        is_cancelled = false;
        stop = std::stop_source();
        script = std::move(asked_script);
        end = end_of(request.handles);
        scene = request.scene;
        started = Clock::now();
        status.state = SolveStatus::State::Preparing;
        status.error.clear();
        status.error_region.clear();
        status.energy_curve.clear();
        status.frames_to_do = 0;
    }

    /// In alone().
    void say_cancelled()
    {
        status.state = SolveStatus::State::Failed;
        status.error = kCancelled;
    }

    void watch(SolveStatus& s, const FrameProgress& now) const
    {
        s.progress = now;
        s.state = SolveStatus::State::Solving;
        std::vector<std::pair<double, double>>& curve = s.energy_curve;
        if (curve.size() >= kCurve) // every second one
        {
            for (std::size_t k = 0; 2 * k < curve.size(); ++k)
                curve[k] = curve[2 * k];
            curve.resize(curve.size() / 2);
        }
        curve.emplace_back(seconds_since(started), now.energy);
    }

    void forget()
    {
        session.reset();
        shape.reset();
    }

    /// Makes the material of the model. Other statements that are asked for meanwhile
    /// wait for it: who edits faster than it is made would never get it. Then it throws
    /// Stopped.
    void make_shape(const HandleFile& handles, CellSettings settings)
    {
        const std::vector<Eigen::Vector3d>& samples = model->geometry.samples;
        if (!settings.is_flat)
        {
            const auto plane = DefaultPlane::of(samples, settings);
            settings.is_flat =
                plane && plane->keeps(handles.stages.front(), handles.is_relative);
        }
        worker.alone([&] { is_making_shape = true; });
        const auto finish = [this]
        {
            is_making_shape = false;
            if (worker.is_asked())
                stop.request_stop();
        };
        try
        {
            shape = build_rest_shape(model->geometry, samples, settings);
        }
        catch (...)
        {
            worker.alone(finish);
            throw;
        }
        worker.alone(finish);
        check_stop();
    }

    /// Brings the session to the statements.
    void solve(const SolveRequest& request)
    {
        if (session_scene.settings != request.scene.settings)
        {
            forget();
            session_scene = request.scene;
        }
        if (session)
            session->set_script(request.handles);
        else
        {
            SessionSettings settings = settings_of(request.scene);
            settings.keeps_checkpoints = true;
            settings.cells.max_memory = default_memory_limit();
            settings.watch = [this](const FrameProgress& now)
            { tell([&](SolveStatus& s) { watch(s, now); }); };
            if (!shape)
                make_shape(request.handles, settings.cells);
            session.emplace(geometry_of(model), request.handles, settings, shape);
            shape.reset();
        }
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
            session->next_frame(left == 1);
    }

    ResultFigures figures() const
    {
        ResultFigures s;
        const CellSystem& system = *session->system();
        s.report.reset();
        if (!session->frames().empty())
            s.report = session->frames().back();
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
        return s;
    }

    Solved result_of(const SolveRequest& request)
    {
        const CellSystem& system = *session->system();
        Solved out;
        out.revision = request.revision;
        out.is_for_drag = request.is_for_drag;
        out.patch = session->shared_deformed();
        out.shape = shown_at(model->geometry, out.patch->samples, request.layout, view);
        out.shape.lines = shown_lines(system, view);
        out.cells = shown_cells(system, system.poses(), view);
        out.stage_fingerprint = session->stage_fingerprint();
        if (!rest || rest_fingerprint != out.stage_fingerprint)
        {
            rest.reset();
            rest = std::make_shared<const std::vector<Eigen::Vector3d>>(
                session->rest_samples());
            rest_fingerprint = out.stage_fingerprint;
        }
        out.rest = rest;
        out.borders = session->borders();
        const auto& regions = system.regions().regions();
        const SessionSettings preview = settings_of(request.scene, true);
        if (std::any_of(regions.begin(), regions.end(),
                        [](const Region& region)
                        {
                            return region.role == Role::Handle ||
                                   region.role == Role::Pin || region.spline != nullptr ||
                                   region.bone.has_value();
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

    /// \p field: of the request that is wrong, where one is.
    void fail(const SolveRequest& request, const std::string& what,
              const std::string& field = "")
    {
        std::string region;
        for (const RegionStatement& statement : request.handles.stages.back().regions)
            if (field == statement.name || field.starts_with(statement.name + ": "))
                region = statement.name;
        tell(
            [&](SolveStatus& s)
            {
                s.state = SolveStatus::State::Failed;
                s.error = what;
                s.error_region = region;
                s.seconds = seconds_since(started);
                s.warnings.clear();
            });
    }

    void work_on(const SolveRequest& request)
    {
        const StopOnRequest scope(worker.alone([&] { return stop.get_token(); }));
        try
        {
            solve(request);
            tell([](SolveStatus& s) { s.state = SolveStatus::State::Field; });
            Solved out = result_of(request);
            out.figures = figures();
            if (out.patch->samples.size() > kFreesAbove)
                release_freed_memory(); // the next drag is made of other arrays
            worker.alone(
                [&]
                {
                    if (is_cancelled) // it may be another request that was waiting
                        return say_cancelled();
                    worker.give(out);
                    status.state = SolveStatus::State::Idle;
                    status.seconds = seconds_since(started);
                    status.warnings = session->warnings();
                });
        }
        catch (const Stopped&)
        {
            worker.alone(
                [&]
                {
                    if (is_cancelled) // else another request is there
                        say_cancelled();
                });
        }
        catch (const Error& error)
        {
            fail(request, error.what(), error.field());
        }
        catch (const std::bad_alloc&)
        {
            forget();
            fail(request, "out of memory: fewer cells need less");
        }
        catch (const std::exception& error)
        {
            forget();
            fail(request, std::string("internal error: ") + error.what());
        }
    }

    void run()
    {
        // Nothing of a request is kept when it is done.
        for (SolveRequest request;
             worker.next(request, [this](const SolveRequest& next) { begin(next); });
             request = {})
            try
            {
                work_on(request);
            }
            catch (const std::exception&) // not even memory to say what was wrong
            {
                forget();
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
    state_->worker.end([&] { state_->stop.request_stop(); });
}

void SolveWorker::ask(SolveRequest request)
{
    State& s = *state_;
    ScriptFingerprint script(request.handles);
    s.worker.ask(std::move(request),
                 [&](const SolveRequest& asked)
                 {
                     const auto goes_on = [&]
                     {
                         return script.has(s.end) &&
                                script.up_to(s.end) == s.script.up_to(s.end) &&
                                asked.scene.settings == s.scene.settings;
                     };
                     const bool is_shape_wanted =
                         s.is_making_shape && asked.scene.settings == s.scene.settings;
                     if (s.worker.is_working() && !goes_on() && !is_shape_wanted)
                         s.stop.request_stop();
                     s.asked_script = std::move(script);
                 });
}

void SolveWorker::cancel()
{
    State& s = *state_;
    s.worker.alone(
        [&]
        {
            if (s.worker.is_asked() && !s.worker.is_working()) // it has not begun
                s.say_cancelled();
            s.worker.forget_request();
            s.is_cancelled = true;
            s.stop.request_stop();
        });
}

std::optional<Solved> SolveWorker::take()
{
    std::optional<Solved> newest;
    state_->worker.take([&](Solved& solved) { newest = std::exchange(solved, {}); });
    return newest;
}

SolveStatus SolveWorker::status() const
{
    return state_->worker.alone(
        [&]
        {
            SolveStatus status = state_->status;
            if (state_->worker.is_working())
                status.seconds = seconds_since(state_->started);
            else if (state_->worker.is_asked())
                status.state = SolveStatus::State::Preparing;
            // Nothing is done before it can be seen.
            if (status.state == SolveStatus::State::Idle && state_->worker.has_result())
                status.state = SolveStatus::State::Field;
            return status;
        });
}

bool SolveWorker::is_busy() const
{
    return state_->worker.alone(
        [&] { return state_->worker.is_working() || state_->worker.is_asked(); });
}

} // namespace cellwarp::core
