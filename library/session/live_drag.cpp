// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/live_drag.h"

#include <chrono>
#include <future>
#include <optional>
#include <stop_token>

#include "library/session/spline_holds.h"
#include "library/session/worker.h"
#include "octree/base/clock.h"
#include "octree/base/parallel.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

/// The hand rests when it has not moved for so long: then smaller cells are made.
constexpr auto kRest = std::chrono::milliseconds(120);

/// How often it is looked whether they are there.
constexpr auto kLook = std::chrono::milliseconds(5);

/// In how many parts a rod goes where it does not get to at once.
constexpr int kPartsOfBend = 4;

/// Numbers of one thread's part of a copy at the least.
constexpr std::size_t kCopyGrain = 1 << 16;

void copy(std::span<const float> from, std::vector<float>& to)
{
    to.resize(from.size());
    parallel_ranges(from.size(), kCopyGrain,
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
        std::vector<SplineHolds> holds; ///< a region; empty for what is no rod or curve
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
    std::vector<SplineHolds> bent_to; ///< by which the splines are where they are
    std::vector<std::shared_ptr<const SplineState>> splines; ///< a region
    bool is_converged = true;
    bool is_refined = true; ///< for where the hand is; before it moves there is no need

    Worker<Hand, Frame> worker;

    explicit State(PreparedDrag from) : prepared(std::move(from))
    {
        status.is_dragging = true;
        splines = prepared.drag->system().splines();
        bent_to.resize(splines.size());
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
            refining = std::async(std::launch::async,
                                  [source = prepared.source,
                                   state = prepared.drag->system().state(),
                                   stop = stop_refining.get_token()]
                                  {
                                      const StopOnRequest scope(stop);
                                      return refined(source, state);
                                  });
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

    /// Takes rods and curves to where the hand has them. One that finds no rest there
    /// stays where it was: the hand may come back.
    void bend()
    {
        for (std::size_t r = 0; r < hand.holds.size(); ++r)
        {
            const SplineHolds& wanted = hand.holds[r];
            if (wanted.empty() || wanted == bent_to[r])
                continue;
            const SplineHandle& rod = *prepared.source.regions->regions()[r].spline;
            const SplineHolds from = bent_to[r].empty() ? wanted : bent_to[r];
            std::optional<HoldWay> way;
            for (const int parts : {1, kPartsOfBend})
            {
                std::shared_ptr<const SplineState> now = splines[r];
                if (parts > 1)
                    way.emplace(rod, *now, from, wanted);
                for (int part = 1; part <= parts && now; ++part)
                    now = rod.moved(*now, way ? way->at(double(part) / parts) : wanted,
                                    false);
                if (!now)
                    continue;
                splines[r] = std::move(now);
                bent_to[r] = wanted;
                break;
            }
        }
    }

    void draw_frame()
    {
        const Clock::time_point bend_start = Clock::now();
        bend();
        const double bend_ms = ms_since(bend_start);
        const DragReport report = prepared.drag->frame(hand.motions, splines);
        splines = prepared.drag->system().splines(); // some push back
        const Stop stop = report.solve.stop;
        is_converged = stop == Stop::Converged || stop == Stop::NoDescent ||
                       stop == Stop::NotPositiveDefinite;
        const SampleBlend& samples = prepared.drag->samples();
        copy(samples.positions(), frame.shape.positions);
        copy(samples.normals(), frame.shape.normals);
        frame.shape.lines = shown_lines(prepared.drag->system(), prepared.source.view);
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
                status.solve_ms = bend_ms + report.solve_ms;
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

void LiveDrag::move(std::vector<Motion> motions, std::vector<SplineHolds> holds)
{
    state_->worker.ask({std::move(motions), std::move(holds), Clock::now()});
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

} // namespace cellwarp::core
