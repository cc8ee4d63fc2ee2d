// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/frame_solver.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <utility>

#include "io/base/error.h"
#include "library/session/turn_chains.h"
#include "octree/base/clock.h"
#include "octree/base/stop_scope.h"
#include "solver/cells/refinement.h"

namespace cellwarp::core
{

namespace
{

/// Tolerance of the steps on the way, good enough to start the next one: the relative
/// gradient, and how far a point may still be from its end [diagonal]. Where a sheet
/// buckles, a mirror image would take another way from a state that is solved less well.
constexpr double kTravelTolerance = 1e-3, kTravelPlace = 1e-2;

/// Tolerance before cells are chosen, or the minima of two ways are compared: the
/// relative gradient, and how far a point may still be from its end [diagonal]. The
/// gradient of a step on the way leaves a hundredth of the diagonal in soft shapes, and
/// errors of cells that are wrong by a factor of two: a mirror image would get other
/// cells.
constexpr double kChoiceTolerance = 1e-5, kChoicePlace = 1e-6;

/// The distance of a point from its end that the last solve may leave [diagonal].
constexpr double kLastPlace = 1e-8;

/// The least part of such a step that a rod goes by itself.
constexpr double kLeastPart = 1.0 / 64.0;

/// Iterations that a step on the way may take in any case (more, up to half of those that
/// are left), and those of one in which folds are to form, at most.
constexpr int kTravelIterations = 30, kFoldIterations = 90;

/// What counts as zero against the forces that cancel; see interface of --json.
constexpr double kUncancelledShare = 1e-3;

/// Where the material is pressed together to less than this share of its length it folds.
constexpr double kFold = 0.2;

/// By what factor the energy of smaller cells may be larger: it converges from either
/// side, but not by more.
constexpr double kRise = 1.02;

/// So many that a long way is gone in larger ones first.
constexpr std::size_t kManyCells = 4000;

/// Iterations of a step that is hard. Where no step of the way is, and none meets a state
/// in which the energy curves downwards, it is gone as fast in the cells themselves.
constexpr int kHardStep = 5;

/// By what factor the energy may rise when poses are handed on to smaller cells. Where
/// cells hold several windings of a thin shape it is a thousand.
constexpr double kTorn = 4.0;

/// Energies that differ by a smaller share are one minimum.
constexpr double kSameEnergy = 1e-5;

/// Two ways that end this near to each other have come to one minimum [a cell's edge].
constexpr double kSamePlace = 1e-2;

/// Where a solve changes the turns from region to region by more, whole turns are lost
/// [rad]: what bends on its way to a solution stays far below.
constexpr double kLostTurn = std::numbers::pi;

} // namespace

const char* second_start_name(SecondStart start)
{
    switch (start)
    {
    case SecondStart::None:
        return "none";
    case SecondStart::Dropped:
        return "dropped";
    case SecondStart::Taken:
        return "taken";
    }
    return "";
}

/// One way through the frame, and what its solves have in common.
struct FrameSolver::Way
{
    Clock::time_point start = Clock::now();
    double gradient_scale = 0.0; ///< before any guess makes the first gradient small
    double energy_before = 0.0;  ///< of the last step of the way
    int part = 1, parts = 1;     ///< of the way
    bool has_risen = false;      ///< the energy, when cells were split
    bool is_wound = false;       ///< a region, by more than half a turn
    bool stays_stable = false;   ///< else turns were lost
    /// Of the regions' chains: where they would be had no solve changed them.
    Eigen::Matrix3Xd turns;
    double largest_rise = 0.0; ///< see FrameReport
    int iterations_lost = 0;   ///< of solves that were taken back: they have no limit
    int iterations_before = 0; ///< of an earlier way of the same frame
    bool is_hard = false;      ///< it has steps as kHardStep says
    SolveReport total;

    bool is_out_of_time() const { return total.stop == Stop::TimeLimit; }
    bool goes_on() const
    {
        return !is_out_of_time() && total.stop != Stop::NotPositiveDefinite;
    }
    /// Whether cells may be chosen by where the last solve has left them: what is not
    /// solved, or not stable, has errors of its own.
    bool may_choose() const
    {
        return goes_on() && !stays_stable && total.stop != Stop::IterationLimit;
    }
};

/// How well a step is solved.
enum class FrameSolver::Accuracy
{
    OnTheWay, ///< to start the next step from there
    Choice,   ///< so well that cells can be chosen, or minima compared
    Folds,    ///< so well that folds have formed
    AsAsked   ///< to the tolerance asked for
};

/// Solves from where the system is.
void FrameSolver::solve_on(Way& way, Accuracy accuracy)
{
    const bool is_last = accuracy == Accuracy::AsAsked;
    const int done =
        way.iterations_before - way.iterations_lost + std::max(0, way.total.iterations);
    SolveOptions options;
    options.method = settings_.method;
    options.gradient_scale = way.gradient_scale;
    options.max_iterations = std::max(0, settings_.max_iterations - done);
    // What gives way must do so before the next step, to be seen.
    if (accuracy == Accuracy::OnTheWay && !way.is_wound)
        options.max_iterations =
            std::max(options.max_iterations / 2,
                     std::min(options.max_iterations, kTravelIterations));
    // Some are left for the cells themselves.
    if (accuracy == Accuracy::Folds)
        options.max_iterations =
            std::clamp(settings_.max_iterations / 2 - done, 0, kFoldIterations);
    options.checks_stability = is_last;
    options.stays_stable = way.stays_stable;
    options.gradient_tolerance =
        is_last ? settings_.gradient_tolerance
        : accuracy == Accuracy::OnTheWay
            ? kTravelTolerance
            : std::max(settings_.gradient_tolerance, kChoiceTolerance);
    options.place_tolerance = (is_last                        ? kLastPlace
                               : accuracy == Accuracy::Choice ? kChoicePlace
                                                              : kTravelPlace) *
                              system_.rest().frame.diagonal();
    if (settings_.time_budget > 0)
        options.time_budget =
            std::max(1e-9, settings_.time_budget - 1e-3 * ms_since(way.start));
    double first = -1.0, last = 0.0; // energies
    options.watch = [&, done](int iteration, double gradient, double energy)
    {
        if (iteration == 0 || !(first > 0.0))
            first = energy;
        else
            way.largest_rise = std::max(way.largest_rise, (energy - last) / first);
        last = energy;
        if (settings_.watch)
            settings_.watch({frames_done_, frame_, way.part, way.parts, done + iteration,
                             gradient, energy});
    };
    // On the way the places that hold a rod come nearer to each other than at either end.
    // Soft rods would fold there: only where the way ends do they push back.
    SolveReport solve = system_.solve(options, way.part < way.parts);
    if (solve.stop == Stop::Stopped)
        throw Stopped();
    way.is_hard |= solve.iterations >= kHardStep || solve.downward_models > 0;
    solve.add_earlier(way.total);
    way.total = solve;
}

/// Whether a solve has changed the turns from region to region.
bool FrameSolver::has_lost_turns(const Way& way) const
{
    const TurnChains chains(system_.body().cells, system_.region_of_cell());
    const Eigen::Matrix3Xd lost = chains.turns(system_.poses()) - way.turns;
    return (lost.colwise().norm().array() > kLostTurn).any();
}

/// solve_on() for material that may be wound: twisted too far it is no longer stable,
/// folds through itself and comes out with less turns. Then it is solved for again, but
/// no farther than to where it would begin to give way. Where that loses turns as well
/// (the energy falls all the way down to where they are gone) it stays as it was.
void FrameSolver::solve_wound(Way& way, Accuracy accuracy)
{
    if (!way.is_wound)
        return solve_on(way, accuracy);
    const CellSystemState before = system_.state();
    const auto solve_from_before = [&]
    {
        const int iterations = std::max(0, way.total.iterations);
        solve_on(way, accuracy);
        if (!has_lost_turns(way))
            return true;
        way.iterations_lost += way.total.iterations - iterations;
        system_.set_state(before);
        return false;
    };
    if (!way.stays_stable)
    {
        if (solve_from_before() || way.is_out_of_time())
            return;
        way.stays_stable = true;
    }
    if (solve_from_before())
        return;
    if (!way.is_out_of_time())
        way.total.stop = Stop::NoDescent;
    way.total.energy_after = system_.energy();
    way.total.gradient = system_.residual().gradient / way.gradient_scale;
}

/// Where a frame began, and in which cells.
struct FrameSolver::Start
{
    std::shared_ptr<const Body> body;
    CellSystemState state;
};

/// The holds from which a rod or curve begins: those of the plan, and the current place
/// of each point that was not held.
SplineHolds FrameSolver::start_of_holds(std::size_t region) const
{
    SplineHolds start = plan_.from_holds[region];
    const SplineState& now = *system_.spline(region);
    const SplineHandle& spline = *system_.regions()[region].spline;
    const std::vector<Eigen::Vector3d> points = now.points();
    for (std::size_t k = 0; k < start.size(); ++k)
    {
        if (!start[k].parts.place)
            start[k].place = points[k];
        if (spline.has_frame_at(k) && !start[k].parts.twist)
            start[k].turn = now.turn_at_point(k);
    }
    return start;
}

void FrameSolver::find_hold_ways()
{
    hold_ways_.assign(plan_.to_holds.size(), std::nullopt);
    for (std::size_t r = 0; r < hold_ways_.size(); ++r)
        if (plan_.from_holds[r] != plan_.to_holds[r])
            hold_ways_[r].emplace(*system_.regions()[r].spline, *system_.spline(r),
                                  start_of_holds(r), plan_.to_holds[r]);
}

/// The rods and curves at \p t of the way, from where they are, at \p last of it. Where a
/// rod does not get there at once it goes in smaller parts. Throws Fault::Unsolvable.
std::vector<std::shared_ptr<const SplineState>> FrameSolver::bent(double last,
                                                                  double t) const
{
    std::vector<std::shared_ptr<const SplineState>> splines = system_.splines();
    for (std::size_t r = 0; r < splines.size(); ++r)
    {
        const Region& region = system_.regions()[r];
        if (plan_.led[r])
            splines[r] = on_the_way(*region.spline, from_splines_[r], plan_.led[r], t);
        if (!hold_ways_[r])
            continue;
        double done = last, part = t - last;
        while (done < t)
        {
            const double next = std::min(done + part, t);
            if (std::shared_ptr<const SplineState> moved =
                    region.spline->moved(*splines[r], hold_ways_[r]->at(next),
                                         part * 0.5 < kLeastPart * (t - last)))
            {
                splines[r] = std::move(moved);
                done = next;
            }
            else if ((part *= 0.5) < kLeastPart * (t - last))
                throw Error(Fault::Unsolvable,
                            at({system_.regions().file(), region.line, region.name},
                               "frame " + std::to_string(frame_) +
                                   ": the rod finds no rest with what holds it there (a "
                                   "move may be too far)"));
        }
    }
    return splines;
}

/// Against which gradients count as zero, after the first step of the regions.
double FrameSolver::gradient_scale_here() const
{
    const Residual first = system_.residual();
    return std::max(first.gradient, kUncancelledShare * first.uncancelled);
}

/// Takes the regions to where this frame has them, in steps. \p at_end: of the last one.
void FrameSolver::travel(Way& way, int& steps, Accuracy at_end)
{
    way.parts = plan_.num_parts;
    const std::vector<PinWay> pins =
        system_.pin_ways(plan_.motions(0.0), plan_.motions(1.0));
    for (const PinWay& pin : pins)
        way.parts = std::max(way.parts, pin.around.num_parts(pin.from, pin.from, 0.0));
    find_hold_ways();
    from_splines_ = system_.splines();
    const double left = system_.driving().way_left();
    double gone = 0.0; ///< of the way
    way.is_wound = plan_.is_wound();
    std::optional<TurnChains> chains;
    if (way.is_wound)
    {
        chains.emplace(system_.body().cells, system_.region_of_cell());
        way.turns = chains->turns(system_.poses());
    }
    for (way.part = 1; way.part <= way.parts; ++way.part)
    {
        // Out of time on the way: straight to the end.
        if (way.is_out_of_time())
            way.part = way.parts;
        if (chains)
            way.turns -= chains->turns(system_.poses());
        const double share = static_cast<double>(way.part) / way.parts;
        std::vector<Motion> motions = plan_.motions(share);
        if (way.part < way.parts)
            for (const PinWay& pin : pins)
                motions[pin.region] = pin.at(share);
        system_.move_regions(motions, bent(gone, share), left * (1.0 - share));
        gone = share;
        if (way.gradient_scale == 0.0)
            way.gradient_scale = gradient_scale_here();
        way.energy_before = system_.energy();
        system_.carry_others();
        if (chains)
            way.turns += chains->turns(system_.poses());
        solve_wound(way, way.part == way.parts ? at_end : Accuracy::OnTheWay);
        ++steps;
        if (way.total.stop == Stop::NotPositiveDefinite)
            break;
    }
    way.part = way.parts;
}

/// Another system in the place of the frame's, for as long as this lasts.
class FrameSolver::Instead
{
public:
    Instead(CellSystem& system, CellSystem& other) : system_(system), other_(other)
    {
        std::swap(system_, other_);
    }
    ~Instead() { std::swap(system_, other_); }
    Instead(const Instead&) = delete;
    Instead& operator=(const Instead&) = delete;

private:
    CellSystem &system_, &other_;
};

/// Calls \p make, which makes other cells, and counts how long that takes. If the time of
/// the frame is used up before they are there, they are dropped, and the way ends with
/// Stop::TimeLimit: then it returns false.
template <class Make>
bool FrameSolver::makes_in_time(Way& way, FrameReport& report, Make&& make) const
{
    const Clock::time_point start = Clock::now();
    bool is_made = true;
    try
    {
        std::optional<StopAtTime> limit;
        if (settings_.time_budget > 0)
            limit.emplace(time_after(way.start, settings_.time_budget));
        make();
    }
    catch (const Stopped&)
    {
        check_stop(); // it may have been asked for from outside
        way.total.stop = Stop::TimeLimit;
        is_made = false;
    }
    report.cells_ms += ms_since(start);
    return is_made;
}

/// Goes on in smaller cells from where the system is; false, with the system as it was,
/// where these cannot take its motions over, or are not made in time.
bool FrameSolver::go_on_in(std::shared_ptr<const Body> body, Way& way, Accuracy accuracy,
                           FrameReport& report)
{
    std::optional<CellSystem> next;
    if (!makes_in_time(way, report,
                       [&] { next = refiner_.handed_to(std::move(body), system_); }) ||
        !(next->energy() <= kTorn * system_.energy()))
        return false;
    system_ = std::move(*next);
    solve_on(way, accuracy);
    return true;
}

/// Goes on in larger cells of which a few are as small as those of \p own, where errors
/// are largest: there folds form. Where that took many iterations some have formed, and
/// errors are largest elsewhere: there a few more are split, until it takes few, or half
/// as many cells as the own ones are reached.
void FrameSolver::fold_in_few_cells(const Body& own, Way& way, FrameReport& report)
{
    solve_on(way, Accuracy::Choice);
    while (way.may_choose())
    {
        std::shared_ptr<const Body> few;
        const int before = way.total.iterations;
        if (!makes_in_time(way, report,
                           [&] { few = refiner_.partly_split(system_, own); }) ||
            2 * few->cells.size() > own.cells.size() ||
            !go_on_in(std::move(few), way, Accuracy::Folds, report) ||
            way.total.iterations - before < kHardStep)
            return;
    }
}

/// travel() in larger cells, from there on solved for in smaller and smaller ones, at
/// last in some that are as small as the system's where errors are largest, to fold
/// there: where the way is long and hard and the cells are many, most iterations then
/// cost little. False, with the system as it was, where that is not so. Rods want small
/// cells of their own, and in larger ones turns of wound material are not told apart.
bool FrameSolver::travel_in_larger_cells(const Start& start, Way& way,
                                         FrameReport& report, Accuracy at_end)
{
    const std::vector<Region>& regions = system_.regions().regions();
    const bool has_rods =
        std::any_of(regions.begin(), regions.end(),
                    [](const Region& region) { return region.spline != nullptr; });
    if (plan_.num_parts == 1 || system_.body().cells.size() < kManyCells ||
        plan_.is_wound() || has_rods)
        return false;
    const Clock::time_point begin = Clock::now();
    const std::vector<std::shared_ptr<const Body>> bodies =
        refiner_.larger_bodies(system_, plan_.motions(1.0));
    if (bodies.empty())
        return false;
    std::optional<CellSystem> in_larger = refiner_.handed_to(bodies.back(), system_);
    report.cells_ms += ms_since(begin);
    const std::shared_ptr<const Body> own = system_.shared_body();
    Way larger;
    larger.start = way.start;
    int steps = 0;
    bool is_worth_it = false;
    {
        const Instead of_own(system_, *in_larger);
        travel(larger, steps, Accuracy::OnTheWay);
        // Out of time it is nearer to the end than the own cells would get from the
        // start.
        is_worth_it = larger.is_hard || larger.is_out_of_time();
        for (std::size_t k = bodies.size() - 1; k-- > 0 && is_worth_it;)
            is_worth_it = go_on_in(bodies[k], larger, Accuracy::OnTheWay, report);
        if (is_worth_it)
            fold_in_few_cells(*own, larger, report);
    }
    report.iterations_in_larger_cells = std::max(0, larger.total.iterations);
    is_worth_it = is_worth_it && larger.total.stop != Stop::NotPositiveDefinite;
    if (is_worth_it)
    {
        // Gradients are measured against those of the first step in these cells.
        const double share = 1.0 / plan_.num_parts;
        system_.move_regions(plan_.motions(share), {},
                             system_.driving().way_left() * (1.0 - share));
        larger.gradient_scale = gradient_scale_here();
        system_.set_state(start.state);
        refiner_.hand_on(*in_larger, system_);
        is_worth_it = system_.energy() <= kTorn * in_larger->energy();
    }
    in_larger.reset(); // its memory is wanted
    if (!is_worth_it)
    {
        system_.set_state(start.state);
        way.total.iterations = 0; // before the first solve it is -1
        way.total.add_earlier(larger.total);
        return false;
    }
    way = larger;
    report.steps += steps;
    if (way.goes_on() && settings_.method != Method::GaussNewtonDirect)
        system_.precondition_here();
    solve_on(way, at_end);
    return true;
}

/// Whether there were other cells to take, and time; they are taken then.
bool FrameSolver::takes(
    std::optional<CellSystem> (CellRefiner::*change)(const CellSystem&), Way& way,
    FrameReport& report)
{
    std::optional<CellSystem> next;
    if (!makes_in_time(way, report, [&] { next = (refiner_.*change)(system_); }) || !next)
        return false;
    system_ = std::move(*next);
    ++report.refinements;
    return true;
}

/// Fits the cells to the deformation: merges first, then splits, so that it ends. What
/// the last, exact solve shows to be still is merged after it.
void FrameSolver::fit_cells(Way& way, FrameReport& report)
{
    while (way.may_choose() && takes(&CellRefiner::coarser, way, report))
        solve_wound(way, Accuracy::Choice);
    for (double before = system_.energy();
         way.may_choose() && takes(&CellRefiner::finer, way, report);)
    {
        solve_wound(way, Accuracy::Choice);
        const double after = system_.energy();
        way.has_risen |= after > kRise * before;
        before = after;
    }
    if (way.goes_on())
        solve_wound(way, Accuracy::AsAsked);
    while (way.may_choose() && takes(&CellRefiner::coarser, way, report))
        solve_wound(way, Accuracy::AsAsked);
    report.cells_at_limit = refiner_.num_at_limit();
}

/// Whether there are signs of a lower minimum than the one found: a direction in which
/// the energy still falls, a fold, which may have formed in large cells where small ones
/// would have it elsewhere, or an energy that rose in smaller cells.
bool FrameSolver::may_miss_a_minimum(const Way& way) const
{
    return way.total.stop == Stop::Converged &&
           (way.total.is_saddle || way.has_risen ||
            least_stretch(system_.body().cells, system_.glue(), system_.constraints(),
                          system_.poses()) < kFold);
}

namespace
{

/// Whether no corner of a cell is farther from its place in the other state than
/// kSamePlace. \pre the cells are the same
bool is_same_place(const CellSystem& a, const CellSystem& b)
{
    const std::vector<Cell>& cells = a.body().cells.cells;
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        const Pose &one = a.poses()[i], &other = b.poses()[i];
        const double bound =
            (one.p - other.p).norm() / cells[i].edge + (one.R - other.R).norm();
        if (!(bound <= kSamePlace))
            return false;
    }
    return true;
}

} // namespace

/// Goes the way of the frame again, in the cells in which it ended, and stays where that
/// leads if it is lower.
void FrameSolver::start_again(const Start& start, Way& way, FrameReport& report)
{
    const double energy = system_.energy();
    Way second;
    second.start = way.start;
    std::optional<CellSystem> made;
    const auto make = [&]
    { made = refiner_.in_cells_of(system_, start.body, start.state); };
    if (!makes_in_time(second, report, make))
        return;
    CellSystem& other = *made;
    std::swap(system_, other);
    second.gradient_scale = way.gradient_scale;
    second.iterations_before = way.total.iterations;
    // Only where another minimum may be ahead is it worth to get there exactly.
    travel(second, report.steps, Accuracy::Choice);
    if (second.goes_on() &&
        (way.total.is_saddle || system_.energy() < (1.0 - kSameEnergy) * energy ||
         !is_same_place(system_, other)))
        solve_wound(second, Accuracy::AsAsked);
    report.largest_rise = std::max(report.largest_rise, second.largest_rise);
    const bool is_lower = second.total.stop == Stop::Converged &&
                          system_.energy() < (1.0 - kSameEnergy) * energy;
    report.second_start = is_lower ? SecondStart::Taken : SecondStart::Dropped;
    if (!is_lower)
    {
        std::swap(system_, other);
        way.total.add_earlier(second.total);
        return;
    }
    second.total.add_earlier(way.total);
    second.iterations_before = 0; // they are in the total now
    way = second;
    fit_cells(way, report);
}

/// Parts the material that this frame's motions part, before anything moves.
void FrameSolver::part_regions(FrameReport& report)
{
    const std::vector<Motion> motions = plan_.motions(1.0);
    const Clock::time_point start = Clock::now();
    while (std::optional<CellSystem> next = refiner_.parted(system_, motions))
    {
        system_ = std::move(*next);
        ++report.refinements;
    }
    report.cells_ms += ms_since(start);
}

void FrameSolver::solve(FrameReport& report)
{
    frame_ = report.frame;
    Way way;
    system_.forget_way();
    part_regions(report);
    const Start start{system_.shared_body(), system_.state()};
    const bool is_adaptive = refiner_.is_adaptive();
    const Accuracy at_end = is_adaptive ? Accuracy::Choice : Accuracy::AsAsked;
    if (!travel_in_larger_cells(start, way, report, at_end))
        travel(way, report.steps, at_end);
    if (is_adaptive)
    {
        fit_cells(way, report);
        if (report.refinements > 0 && may_miss_a_minimum(way))
            start_again(start, way, report);
    }
    is_left_wound_ = way.stays_stable;
    report.solve = way.total;
    report.largest_rise = std::max(report.largest_rise, way.largest_rise);
    report.solve.energy_before = way.energy_before;
}

} // namespace cellwarp::core
