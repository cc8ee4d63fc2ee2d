// SPDX-License-Identifier: GPL-3.0-or-later
// Solves one frame: takes the regions their way in steps, each from the poses of the one
// before, so that large turns do not tear the glue, and fits the cells to what comes out.
// Only the last step is solved to the tolerance asked for; where a long way is gone in
// larger cells first, folds form to a tolerance of their own.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "library/session/cell_refiner.h"
#include "library/session/cell_system.h"
#include "library/session/frame_plan.h"
#include "library/session/frame_report.h"
#include "library/session/session_settings.h"
#include "library/session/spline_holds.h"

namespace cellwarp::core
{

class FrameSolver
{
public:
    /// Works on \p system, which may have other cells afterwards, those of \p refiner.
    /// All must outlive it. \p frames_done: before this one, for the watch.
    FrameSolver(CellSystem& system, CellRefiner& refiner, const FramePlan& plan,
                const SessionSettings& settings, std::size_t frames_done)
        : system_(system), refiner_(refiner), plan_(plan), settings_(settings),
          frames_done_(frames_done)
    {
    }

    /// Goes the way from where the system is. \p report has the frame's number.
    void solve(FrameReport& report);
    /// Whether the material was left where it would have begun to lose turns.
    bool is_left_wound() const { return is_left_wound_; }

private:
    struct Way;
    struct Start;
    class Instead;
    enum class Accuracy;

    void solve_on(Way& way, Accuracy accuracy);
    bool has_lost_turns(const Way& way) const;
    void solve_wound(Way& way, Accuracy accuracy);
    void travel(Way& way, int& steps, Accuracy at_end);
    bool go_on_in(std::shared_ptr<const Body> body, Way& way, Accuracy accuracy,
                  FrameReport& report);
    void fold_in_few_cells(const Body& own, Way& way, FrameReport& report);
    bool travel_in_larger_cells(const Start& start, Way& way, FrameReport& report,
                                Accuracy at_end);
    double gradient_scale_here() const;
    template <class Make>
    bool makes_in_time(Way& way, FrameReport& report, Make&& make) const;
    bool takes(std::optional<CellSystem> (CellRefiner::*change)(const CellSystem&),
               Way& way, FrameReport& report);
    void fit_cells(Way& way, FrameReport& report);
    bool may_miss_a_minimum(const Way& way) const;
    void start_again(const Start& start, Way& way, FrameReport& report);
    void part_regions(FrameReport& report);
    SplineHolds start_of_holds(std::size_t region) const;
    void find_hold_ways();
    std::vector<std::shared_ptr<const SplineState>> bent(double last, double t) const;

    CellSystem& system_;
    CellRefiner& refiner_;
    const FramePlan& plan_;
    const SessionSettings& settings_;
    std::size_t frames_done_;
    std::int64_t frame_ = 0;                        ///< its number
    std::vector<std::optional<HoldWay>> hold_ways_; ///< of rods and curves that move
    std::vector<std::shared_ptr<const SplineState>> from_splines_;
    bool is_left_wound_ = false;
};

} // namespace cellwarp::core
