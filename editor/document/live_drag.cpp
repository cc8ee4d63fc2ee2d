// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/live_drag.h"

#include <chrono>
#include <condition_variable>
#include <future>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "octree/base/clock.h"
#include "octree/base/parallel.h"

namespace cellwarp
{

namespace
{

/// The hand rests when it has not moved for so long: then smaller cells are made.
constexpr auto kRest = std::chrono::milliseconds(120);

/// How often it is looked whether they are there.
constexpr auto kLook = std::chrono::milliseconds(5);

/// Numbers of one thread's part of a copy at the least.
constexpr std::size_t kGrain = 1 << 16;

void copy(std::span<const float> from, std::vector<float>& to)
{
    to.resize(from.size());
    parallel_ranges(from.size(), kGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        std::copy(from.begin() + static_cast<std::ptrdiff_t>(begin),
                                  from.begin() + static_cast<std::ptrdiff_t>(end),
                                  to.begin() + static_cast<std::ptrdiff_t>(begin));
                    });
}

} // namespace

struct LiveDrag::State
{
    // Shared.
    mutable std::mutex mutex;
    std::condition_variable wake;
    std::vector<Motion> motions; ///< newest
    Clock::time_point moved_at = Clock::now();
    bool has_moved = false, is_stopping = false, shows_cells = false;
    ShownShape ready;
    ShownCells ready_cells;
    bool is_ready = false;
    DragStatus status;

    // Of the thread.
    PreparedDrag prepared;
    Refining refining;
    std::stop_source stop_refining;
    ShownShape back;
    std::vector<Motion> now;
    Clock::time_point now_at;
    bool is_converged = true;
    bool is_refined = true; ///< for where the hand is; before it moves there is no need

    std::jthread thread;

    explicit State(PreparedDrag from) : prepared(std::move(from))
    {
        status.is_dragging = true;
        status.cells = prepared.source.body->cells.size();
        thread = std::jthread([this] { run(); });
    }

    enum class Work
    {
        End,
        Frame,
        Refine,
        TakeRefined
    };

    bool is_refining_done() const
    {
        return refining.valid() &&
               refining.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    }

    Work next_work()
    {
        std::unique_lock lock(mutex);
        for (;;)
        {
            if (is_stopping)
                return Work::End;
            if (is_refining_done())
                return Work::TakeRefined;
            if (has_moved)
            {
                now = motions;
                now_at = moved_at;
                has_moved = is_refined = is_converged = false;
            }
            if (!is_converged)
                return Work::Frame;
            if (refining.valid())
                wake.wait_for(lock, kLook);
            else if (is_refined)
                wake.wait(lock);
            else if (Clock::now() >= moved_at + kRest)
                return Work::Refine;
            else
                wake.wait_until(lock, moved_at + kRest);
        }
    }

    void refine()
    {
        is_refined = true;
        try
        {
            refining =
                std::async(std::launch::async, [source = prepared.source,
                                                state = prepared.drag->system().state(),
                                                stop = stop_refining.get_token()]
                           { return refined(source, state, stop); });
        }
        catch (const std::exception&)
        {
            // No thread or no memory is left: these cells do.
        }
    }

    /// Goes on in smaller cells, from where they were wanted to where the hand is now.
    void take_refined()
    {
        std::optional<PreparedDrag> made;
        try
        {
            made = refining.get();
        }
        catch (const std::exception&)
        {
            // Smaller cells cannot be: these do.
        }
        if (!made)
            return;
        prepared = std::move(*made);
        is_converged = false;
        const std::lock_guard lock(mutex);
        status.cells = prepared.source.body->cells.size();
    }

    void draw_frame()
    {
        const DragReport report = prepared.drag->frame(now);
        const Stop stop = report.solve.stop;
        is_converged = stop == Stop::Converged || stop == Stop::NoDescent ||
                       stop == Stop::NotPositiveDefinite;
        const SampleBlend& samples = prepared.drag->samples();
        copy(samples.positions(), back.positions);
        copy(samples.normals(), back.normals);
        back.layout = prepared.layout;
        back.to_view = prepared.to_view;
        bool with_cells = false;
        {
            const std::lock_guard lock(mutex);
            with_cells = shows_cells;
        }
        ShownCells cells;
        if (with_cells)
            cells = shown_cells(prepared.drag->system(), prepared.drag->system().poses(),
                                prepared.source.view);
        const std::lock_guard lock(mutex);
        std::swap(ready, back);
        std::swap(ready_cells, cells);
        is_ready = true;
        status.solve_ms = report.solve_ms;
        status.blend_ms = report.blend_ms;
        status.latency_ms = ms_since(now_at);
        ++status.frames;
    }

    void work()
    {
        for (;;)
            switch (next_work())
            {
            case Work::End:
                return;
            case Work::Frame:
                draw_frame();
                break;
            case Work::Refine:
                refine();
                break;
            case Work::TakeRefined:
                take_refined();
                break;
            }
    }

    /// A frame that cannot be ends the display, and neither the edit nor the program.
    void run()
    {
        try
        {
            work();
        }
        catch (const std::exception& error)
        {
            const std::lock_guard lock(mutex);
            status.error = error.what();
        }
    }

    void end()
    {
        {
            const std::lock_guard lock(mutex);
            is_stopping = true;
        }
        stop_refining.request_stop();
        wake.notify_all();
        if (thread.joinable())
            thread.join();
    }
};

LiveDrag::LiveDrag(PreparedDrag prepared)
    : state_(std::make_unique<State>(std::move(prepared)))
{
}

LiveDrag::~LiveDrag()
{
    state_->end();
}

void LiveDrag::move(std::vector<Motion> motions)
{
    {
        const std::lock_guard lock(state_->mutex);
        state_->motions = std::move(motions);
        state_->has_moved = true;
        state_->moved_at = Clock::now();
    }
    state_->wake.notify_all();
}

void LiveDrag::show_cells(bool shows)
{
    const std::lock_guard lock(state_->mutex);
    state_->shows_cells = shows;
}

bool LiveDrag::take(ShownShape& shape, ShownCells& cells)
{
    const std::lock_guard lock(state_->mutex);
    if (!state_->is_ready)
        return false;
    std::swap(shape, state_->ready);
    if (!state_->ready_cells.cells.empty())
        std::swap(cells, state_->ready_cells);
    state_->is_ready = false;
    return true;
}

DragStatus LiveDrag::status() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->status;
}

std::optional<PreparedDrag> LiveDrag::stop()
{
    state_->end();
    if (!state_->status.error.empty())
        return std::nullopt;
    return std::move(state_->prepared);
}

Refining LiveDrag::take_refining()
{
    return std::move(state_->refining);
}

} // namespace cellwarp
