// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/live_drag.h"

#include <chrono>
#include <future>
#include <optional>
#include <stop_token>

#include "editor/document/worker.h"
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
    struct Hand
    {
        std::vector<Motion> motions;
        Clock::time_point moved_at = Clock::now();
    };
    struct Frame
    {
        ShownShape shape;
        ShownCells cells;
    };

    // Shared.
    bool shows_cells = false;
    DragStatus status;

    // Of the thread.
    PreparedDrag prepared;
    Refining refining;
    std::stop_source stop_refining;
    Frame frame;
    Hand hand;
    bool is_converged = true;
    bool is_refined = true; ///< for where the hand is; before it moves there is no need

    Worker<Hand, Frame> worker;

    explicit State(PreparedDrag from) : prepared(std::move(from))
    {
        status.is_dragging = true;
        status.cells = prepared.source.body->cells.size();
        worker.start([this] { run(); });
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
        for (;;)
        {
            if (worker.is_ending())
                return Work::End;
            if (is_refining_done())
                return Work::TakeRefined;
            if (worker.take_request(hand))
                is_refined = is_converged = false;
            if (!is_converged)
                return Work::Frame;
            if (refining.valid())
                worker.wait(Clock::now() + kLook);
            else if (is_refined)
                worker.wait();
            else if (Clock::now() >= hand.moved_at + kRest)
                return Work::Refine;
            else
                worker.wait(hand.moved_at + kRest);
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
        worker.alone([&] { status.cells = prepared.source.body->cells.size(); });
    }

    void draw_frame()
    {
        const DragReport report = prepared.drag->frame(hand.motions);
        const Stop stop = report.solve.stop;
        is_converged = stop == Stop::Converged || stop == Stop::NoDescent ||
                       stop == Stop::NotPositiveDefinite;
        const SampleBlend& samples = prepared.drag->samples();
        copy(samples.positions(), frame.shape.positions);
        copy(samples.normals(), frame.shape.normals);
        frame.shape.layout = prepared.layout;
        frame.shape.to_view = prepared.to_view;
        const bool with_cells = worker.alone([&] { return shows_cells; });
        frame.cells = with_cells ? shown_cells(prepared.drag->system(),
                                               prepared.drag->system().poses(),
                                               prepared.source.view)
                                 : ShownCells();
        worker.alone(
            [&]
            {
                worker.give(frame);
                status.solve_ms = report.solve_ms;
                status.blend_ms = report.blend_ms;
                status.latency_ms = ms_since(hand.moved_at);
                ++status.frames;
            });
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
            worker.alone([&] { status.error = error.what(); });
        }
    }

    void end()
    {
        stop_refining.request_stop();
        worker.end();
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
    state_->worker.ask({std::move(motions), Clock::now()});
}

void LiveDrag::show_cells(bool shows)
{
    state_->worker.alone([&] { state_->shows_cells = shows; });
}

bool LiveDrag::take(ShownShape& shape, ShownCells& cells)
{
    return state_->worker.take(
        [&](State::Frame& frame)
        {
            std::swap(shape, frame.shape);
            if (!frame.cells.cells.empty())
                std::swap(cells, frame.cells);
        });
}

DragStatus LiveDrag::status() const
{
    return state_->worker.alone([&] { return state_->status; });
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
