// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/half_turn_ways.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "library/session/frame_solver.h"

namespace cellwarp::core
{

namespace
{

/// Energies that differ by a smaller share may do so by their cells alone: the first way
/// is kept then, so that rounding does not decide.
constexpr double kEqualWays = 0.02;

/// An energy below this counts as none [work^3].
constexpr double kNoEnergy = 1e-20;

bool is_finished(const FrameReport& report)
{
    const Stop stop = report.solve.stop;
    return stop != Stop::TimeLimit && stop != Stop::Stopped;
}

bool is_lower(const CellSystem& other, const FrameReport& of_other,
              const CellSystem& first, const FrameReport& of_first)
{
    if (of_other.solve.stop == Stop::NotPositiveDefinite || !is_finished(of_other))
        return false;
    return of_first.solve.stop == Stop::NotPositiveDefinite ||
           other.energy() < (1.0 - kEqualWays) * first.energy() - kNoEnergy;
}

/// Counts another way of the same frame.
void add(FrameReport& report, const FrameReport& other)
{
    report.solve.add_earlier(other.solve);
    report.steps += other.steps;
    report.iterations_in_larger_cells += other.iterations_in_larger_cells;
    report.refinements += other.refinements;
    report.largest_rise = std::max(report.largest_rise, other.largest_rise);
    report.cells_ms += other.cells_ms;
}

std::string names_of(const CellSystem& system, const std::vector<std::size_t>& regions)
{
    std::string names;
    for (const std::size_t r : regions)
        names += (names.empty() ? "" : ", ") + system.regions()[r].name;
    return names;
}

} // namespace

SolvedWays solve_half_turns(CellSystem& system, CellRefiner& refiner,
                            const FramePlan& plan, const SessionSettings& settings,
                            std::size_t frames_done, FrameReport& report)
{
    SolvedWays out;
    const std::shared_ptr<const Body> body = system.shared_body();
    const CellSystemState start = system.state();
    const FrameReport empty = report;
    const auto solve = [&](CellSystem& in, const FramePlan& way, FrameReport& of_way)
    {
        FrameSolver solver(in, refiner, way, settings, frames_done);
        solver.solve(of_way);
        return solver.is_left_wound();
    };
    FramePlan kept = plan;
    out.is_left_wound = solve(system, kept, report);
    for (const std::vector<std::size_t>& group : plan.half_turns)
    {
        const std::string turns =
            fmt::format("frame {}: {} turns by 180° with nothing that says which way "
                        "round (rotate does)",
                        report.frame, names_of(system, group));
        if (!is_finished(report))
        {
            out.warnings.push_back(turns + ": one way was tried, there is no time left");
            continue;
        }
        FramePlan reversed = kept.reversed(group);
        CellSystem other = refiner.handed_to(body, system);
        other.set_state(start);
        FrameReport of_other = empty;
        const bool is_left_wound = solve(other, reversed, of_other);
        const bool is_taken = is_lower(other, of_other, system, report);
        const double energies[] = {system.energy(), other.energy()};
        out.warnings.push_back(
            turns + fmt::format(": both ways were solved, that of energy {:.3g} was kept "
                                "(the other: {:.3g})",
                                energies[is_taken], energies[!is_taken]));
        if (is_taken)
        {
            std::swap(system, other);
            std::swap(report, of_other);
            kept = std::move(reversed);
            out.is_left_wound = is_left_wound;
        }
        add(report, of_other);
    }
    return out;
}

} // namespace cellwarp::core
