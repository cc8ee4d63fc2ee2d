// SPDX-License-Identifier: GPL-3.0-or-later
// One stage lasts from the start, or a commit, to the next commit: its cells,
// regions and frames. A frame travels from the last one's motions to its own in
// steps; each step starts from the poses of the one before, so large turns do not
// tear the glue. Only the last step is solved to the tolerance asked for.
#include "editor/session/session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <numeric>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "editor/session/carrying.h"
#include "editor/session/deformation.h"
#include "io/error.h"
#include "io/number.h"
#include "octree/parallel.h"
#include "solver/field/turning.h"

namespace cellwarp
{

namespace
{

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start)
{
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// Tolerance of the steps on the way: good enough to start the next one.
constexpr double kTravelTolerance = 1e-3;

/// Iterations of a step on the way, at most.
constexpr int kTravelIterations = 30;

/// Two motions of one sample that differ by no more are one [diagonal].
constexpr double kSameMotion = 1e-12;

/// What counts as zero against the forces that cancel; see interface of --json.
constexpr double kUncancelledShare = 1e-3;

/// More cells at the depth limit than this get a warning [cells].
constexpr double kManyAtLimit = 0.02;

/// A handle that travels farther than this gets a warning [diagonal].
constexpr double kExtremeMove = 100.0;

/// The volume that a closed mesh, its faces as fans, encloses: a sixth of the sum of
/// the triple products.
double enclosed_volume(const Geometry& geometry,
                       const std::vector<Eigen::Vector3d>& samples)
{
    const Eigen::Vector3d origin = samples.front();
    double sum = 0.0;
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        const Eigen::Vector3d a = samples[corners[0]] - origin;
        for (std::size_t k = 2; k < corners.size(); ++k)
            sum += a.dot(
                (samples[corners[k - 1]] - origin).cross(samples[corners[k]] - origin));
    }
    return sum / 6.0;
}

/// Whether every edge has exactly two faces, which pass it in opposite directions.
bool is_closed(const Geometry& geometry)
{
    if (geometry.num_faces() == 0)
        return false;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
    edges.reserve(geometry.corners.size());
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        for (std::size_t k = 0; k < corners.size(); ++k)
            edges.emplace_back(corners[k], corners[(k + 1) % corners.size()]);
    }
    std::sort(edges.begin(), edges.end());
    if (std::adjacent_find(edges.begin(), edges.end()) != edges.end())
        return false;
    return std::all_of(edges.begin(), edges.end(),
                       [&](const auto& edge)
                       {
                           return edge.first != edge.second &&
                                  std::binary_search(edges.begin(), edges.end(),
                                                     std::pair(edge.second, edge.first));
                       });
}

} // namespace

/// Everything that belongs to one stage.
struct Session::StageState
{
    StageState(Recutting of_rest, Units in_units)
        : recutting(std::move(of_rest)), rig(recutting.first()), units(in_units)
    {
    }

    Recutting recutting;
    Rig rig;
    Units units;
    SolveReport last_solve;
    /// Frames as motions: paths[frame][region].
    std::vector<std::vector<Path>> paths;
    std::vector<int> num_parts;
    std::optional<FieldFitter> fitter; ///< of the rig's cells
    std::unique_ptr<Field> field;
};

Session::~Session() = default;
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;

const Field* Session::field() const
{
    return state_ ? state_->field.get() : nullptr;
}

const Rig* Session::rig() const
{
    return state_ ? &state_->rig : nullptr;
}

Session::Session(GeometryFile model, HandleFile handles, SessionSettings settings)
    : model_(std::move(model)), handles_(std::move(handles)),
      settings_(std::move(settings))
{
    const Geometry& geometry = model_.geometry;
    rest_ = {geometry.samples, {}, geometry.tangents, geometry.rotations};
    for (const DirectionUse& use : direction_uses(geometry))
    {
        rest_.directions.push_back(geometry.directions[use.direction]);
        use_samples_.push_back(use.sample);
    }
    patch_ = rest_;
    parts_.faces = geometry.num_faces() > 0;
    warnings_ = geometry.warnings;
    const bool has_frames =
        std::any_of(handles_.stages.begin(), handles_.stages.end(),
                    [](const Stage& stage) { return !stage.frames.empty(); });
    if (!has_frames)
    {
        warnings_.push_back("no frame: nothing to do, the output is the input");
        stage_ = handles_.stages.size();
        return;
    }
    start_stage(0);
}

void Session::start_stage(std::size_t stage)
{
    stage_ = stage;
    frame_ = 0;
    const Stage& statements = handles_.stages[stage];
    const auto rest = build_rest_shape(model_.geometry, rest_.samples, settings_.cells);
    parts_.interior += rest->material.method != InsideMethod::None;
    warnings_.insert(warnings_.end(), rest->warnings.begin(), rest->warnings.end());
    const Units units{rest->frame, handles_.is_relative, bounding_box(rest_.samples)};
    const auto regions = std::make_shared<const RegionSet>(
        rest,
        resolve_regions(statements.regions, model_.geometry, rest_.samples, units,
                        handles_.path),
        handles_.path);
    state_ = std::make_unique<StageState>(
        Recutting(rest, regions, settings_.cells,
                  {settings_.cells.max_memory, settings_.method}),
        units);
    for (std::string& warning : state_->recutting.take_warnings())
        warnings_.push_back(std::move(warning));
    const std::vector<std::string>& more = state_->rig.warnings();
    warnings_.insert(warnings_.end(), more.begin(), more.end());
    check_memory_of(settings_.field);
    plan_frames(statements.frames);
}

void Session::check_memory_of(const FieldChoice& field) const
{
    if (field.kind != FieldKind::RbfGlobal)
        return;
    const Rig& rig = state_->rig;
    std::vector<int> all(rig.poses().size());
    std::iota(all.begin(), all.end(), 0);
    const std::size_t centres = CentreChoice(rig.body().cells, rig.constraints())
                                    .centres_of(all, rig.poses())
                                    .points.size();
    const double bytes = RbfSystem::memory_estimate(centres);
    if (settings_.cells.max_memory > 0 && bytes > settings_.cells.max_memory)
        throw Error(Fault::Budget,
                    fmt::format("the global release field of {} centres needs {} (limit "
                                "{}): the local one, rbf, needs less",
                                centres, in_bytes(bytes),
                                in_bytes(settings_.cells.max_memory)));
}

/// All frames as paths, so that a wrong one fails before the first is solved.
void Session::plan_frames(const std::vector<FrameStatement>& frames)
{
    StageState& s = *state_;
    std::vector<std::vector<Step>> now(s.rig.regions().size());
    for (const FrameStatement& frame : frames)
    {
        std::vector<Path>& paths = s.paths.emplace_back();
        std::vector<Motion> motions;
        std::map<std::string, const Move*> moves;
        for (const Move& move : frame.moves)
            moves[move.region] = &move;
        int parts = 1;
        for (std::size_t r = 0; r < s.rig.regions().size(); ++r)
        {
            const auto found = moves.find(s.rig.regions()[r].name);
            const Move* move = found == moves.end() ? nullptr : found->second;
            std::vector<Step> next = now[r];
            if (move)
            {
                const Eigen::Vector3d centre = s.rig.regions().box(r).centre();
                const bool is_placed = std::any_of(
                    move->operations.begin(), move->operations.end(),
                    [](const Operation& o) { return o.kind == Operation::Kind::To; });
                if (is_placed && s.rig.regions().box(r).size().norm() >
                                     1e-9 * s.rig.rest().frame.diagonal())
                    throw malformed(
                        {handles_.path, move->line, move->region},
                        "'to' needs a pin of one place; this one has " +
                            std::to_string(s.rig.regions()[r].samples.size()) +
                            " samples, use translate");
                next = steps_of(*move, s.units, centre, s.rig.regions().box(r).low,
                                handles_.path, warnings_);
            }
            const Path path = paths.emplace_back(now[r], next);
            now[r] = std::move(next);
            motions.push_back(path.at(1.0));
            if (s.rig.regions()[r].prescribes())
            {
                parts = std::max(parts, path.num_parts(s.rig.regions().box(r).low,
                                                       s.rig.regions().box(r).high,
                                                       s.rig.rest().frame.diagonal()));
                const Eigen::Vector3d centre = s.rig.regions().box(r).centre();
                if (s.rig.rest().frame.diagonal() > 0 &&
                    (motions.back()(centre) - centre).norm() >
                        kExtremeMove * s.rig.rest().frame.diagonal())
                    warnings_.push_back(fmt::format("frame {}: {} moves by more than {} "
                                                    "diagonals: the shape is stretched "
                                                    "to an extreme",
                                                    frame.number, s.rig.regions()[r].name,
                                                    kExtremeMove));
            }
        }
        s.num_parts.push_back(parts);
        check_overlaps(motions, frame.line);
    }
}

void Session::check_overlaps(const std::vector<Motion>& motions, std::int64_t line) const
{
    const StageState& s = *state_;
    for (const RegionSet::Overlap& overlap : s.rig.regions().overlaps())
    {
        const Eigen::Vector3d& x = s.rig.rest().samples[overlap.sample];
        const double apart = (motions[overlap.a](x) - motions[overlap.b](x)).norm();
        const double scale =
            std::max(s.rig.rest().frame.diagonal(), motions[overlap.a](x).norm());
        if (!(apart <= kSameMotion * scale))
            throw malformed(
                {handles_.path, line, s.rig.regions()[overlap.a].name},
                fmt::format("and {} (line {}) both hold sample {} and move it "
                            "differently ({:.3g} of the diagonal apart)",
                            s.rig.regions()[overlap.b].name,
                            s.rig.regions()[overlap.b].line, overlap.sample,
                            apart / s.rig.rest().frame.diagonal()));
    }
}

std::optional<std::int64_t> Session::upcoming_frame() const
{
    std::size_t stage = stage_, frame = frame_;
    while (stage < handles_.stages.size() &&
           frame >= handles_.stages[stage].frames.size())
    {
        ++stage;
        frame = 0;
    }
    if (stage >= handles_.stages.size())
        return std::nullopt;
    return handles_.stages[stage].frames[frame].number;
}

bool Session::next_frame(bool wants_samples)
{
    if (!upcoming_frame())
        return false;
    double cells_ms = 0.0;
    while (frame_ >= handles_.stages[stage_].frames.size())
    {
        const Clock::time_point start = Clock::now();
        commit();
        start_stage(stage_ + 1);
        cells_ms += ms_since(start);
    }
    const Stage& stage = handles_.stages[stage_];
    FrameReport& report = reports_.emplace_back();
    report.frame = stage.frames[frame_].number;
    report.cells_ms = cells_ms;
    const Clock::time_point start = Clock::now();
    solve_frame(report);
    report.solve_ms = ms_since(start) - (report.cells_ms - cells_ms);
    ++frame_;
    const bool is_committed =
        frame_ == stage.frames.size() && stage_ + 1 < handles_.stages.size();
    if (wants_samples || is_committed)
        move_samples(report);
    return true;
}

/// Whether no region moves, and the last solution stands: it is not polished to other
/// bits.
bool Session::stands() const
{
    const StageState& s = *state_;
    return frame_ > 0 && s.last_solve.stop == Stop::Converged &&
           std::all_of(s.paths[frame_].begin(), s.paths[frame_].end(),
                       [](const Path& path)
                       {
                           const Motion from = path.at(0.0), to = path.at(1.0);
                           return from.R == to.R && from.t == to.t;
                       });
}

/// Moves the regions to \p t of this frame's way.
void Session::move_regions(double t)
{
    std::vector<Motion> motions;
    for (const Path& path : state_->paths[frame_])
        motions.push_back(path.at(t));
    state_->rig.move_regions(motions);
}

/// What the solves of one frame have in common.
struct Session::FrameSolve
{
    Clock::time_point start = Clock::now();
    double gradient_scale = 0.0; ///< before any guess makes the first gradient small
    double energy_before = 0.0;  ///< of the last step of the way
    int part = 1, parts = 1;     ///< of the way
    SolveReport total;

    bool is_out_of_time() const
    {
        return total.stop == Stop::TimeLimit || total.stop == Stop::Stopped;
    }
};

/// Solves from where the rig is; \p is_last: to the tolerance asked for, else well enough
/// to go on from there.
void Session::solve_on(FrameSolve& frame, bool is_last)
{
    StageState& s = *state_;
    const int done = std::max(0, frame.total.iterations);
    SolveOptions options;
    options.method = settings_.method;
    options.stop = settings_.stop;
    options.gradient_scale = frame.gradient_scale;
    options.max_iterations = std::max(0, settings_.max_iterations - done);
    if (!is_last)
        options.max_iterations = std::min(options.max_iterations, kTravelIterations);
    options.checks_stability = is_last;
    options.gradient_tolerance =
        is_last ? settings_.gradient_tolerance : kTravelTolerance;
    if (settings_.time_budget > 0)
        options.time_budget =
            std::max(1e-9, settings_.time_budget - 1e-3 * ms_since(frame.start));
    if (settings_.watch)
        options.watch = [&, done](int iteration, double gradient)
        {
            settings_.watch({reports_.size() - 1, reports_.back().frame, frame.part,
                             frame.parts, done + iteration, gradient});
        };
    SolveReport solve = s.rig.solve(options);
    solve.add_earlier(frame.total);
    frame.total = solve;
}

/// Takes the regions to where this frame has them, in steps.
void Session::travel(FrameSolve& frame, int& steps)
{
    StageState& s = *state_;
    frame.parts = s.num_parts[frame_];
    for (frame.part = 1; frame.part <= frame.parts; ++frame.part)
    {
        // Out of time on the way: straight to the end.
        if (frame.is_out_of_time())
            frame.part = frame.parts;
        move_regions(static_cast<double>(frame.part) / frame.parts);
        if (frame.gradient_scale == 0.0)
        {
            const Residual first = s.rig.residual();
            frame.gradient_scale =
                std::max(first.gradient, kUncancelledShare * first.uncancelled);
        }
        frame.energy_before = s.rig.energy();
        s.rig.carry_others();
        solve_on(frame, frame.part == frame.parts && !s.recutting.is_adaptive());
        ++steps;
        if (frame.total.stop == Stop::NotPositiveDefinite)
            break;
    }
    frame.part = frame.parts;
}

/// Whether there were other cells to take; they are taken then.
bool Session::takes(std::optional<Rig> (Recutting::*change)(const Rig&),
                    FrameReport& report)
{
    StageState& s = *state_;
    const Clock::time_point start = Clock::now();
    std::optional<Rig> next = (s.recutting.*change)(s.rig);
    if (next)
    {
        s.fitter.reset();
        s.rig = std::move(*next);
        ++report.recuts;
    }
    report.cells_ms += ms_since(start);
    return next.has_value();
}

/// Fits the cells to the deformation: merges first, then splits, so that it ends. What
/// the last, exact solve shows to be still is merged after it.
void Session::recut(FrameSolve& frame, FrameReport& report)
{
    const auto go_on = [&]
    { return !frame.is_out_of_time() && frame.total.stop != Stop::NotPositiveDefinite; };
    for (const auto change : {&Recutting::coarser, &Recutting::finer})
        while (go_on() && takes(change, report))
            solve_on(frame, false);
    if (go_on())
        solve_on(frame, true);
    while (go_on() && takes(&Recutting::coarser, report))
        solve_on(frame, true);
    report.cells_at_limit = state_->recutting.num_at_limit();
}

/// Parts the material that this frame's motions part, before anything moves.
void Session::part_regions(FrameReport& report)
{
    StageState& s = *state_;
    std::vector<Motion> motions;
    for (const Path& path : s.paths[frame_])
        motions.push_back(path.at(1.0));
    const Clock::time_point start = Clock::now();
    while (std::optional<Rig> next = s.recutting.parted(s.rig, motions))
    {
        s.fitter.reset();
        s.rig = std::move(*next);
        ++report.recuts;
    }
    report.cells_ms += ms_since(start);
}

void Session::solve_frame(FrameReport& report)
{
    StageState& s = *state_;
    if (stands())
    {
        const SolveReport last = s.last_solve;
        s.last_solve = {};
        s.last_solve.stop = last.stop;
        s.last_solve.iterations = 0;
        s.last_solve.energy_before = s.last_solve.energy_after = last.energy_after;
        s.last_solve.gradient = last.gradient;
    }
    else
    {
        s.field.reset(); // it is of the last frame's cells
        part_regions(report);
        FrameSolve frame;
        travel(frame, report.steps);
        if (s.recutting.is_adaptive())
            recut(frame, report);
        s.last_solve = frame.total;
        s.last_solve.energy_before = frame.energy_before;
    }
    for (std::string& warning : s.recutting.take_warnings())
        warnings_.push_back(std::move(warning));
    if (report.cells_at_limit > kManyAtLimit * static_cast<double>(s.rig.poses().size()))
        warnings_.push_back(fmt::format(
            "frame {}: depth limit reached in {} cells: their error is above the "
            "threshold (a larger --max-depth lets them split)",
            report.frame, report.cells_at_limit));
    const SolveReport& total = s.last_solve;
    report.solve = total;
    if (total.stop == Stop::NotPositiveDefinite)
        throw Error(Fault::Unsolvable,
                    at({handles_.path, 0, "frame " + std::to_string(report.frame)},
                       "the equations have no solution in finite numbers, also damped (a "
                       "move may be too far)"));
    if (total.is_saddle)
        warnings_.push_back(
            fmt::format("frame {}: the result may not be stable: its energy "
                        "falls in some direction",
                        report.frame));
    report.cells = s.rig.body().cells.size();
    parts_.refinement += report.recuts;
    report.max_pair_gap = s.rig.largest_gap();
}

/// Of the last frame.
std::vector<MovedRegion> Session::moved_regions() const
{
    const StageState& s = *state_;
    std::vector<MovedRegion> moved;
    for (std::size_t r = 0; r < s.rig.regions().size(); ++r)
        if (s.rig.fade(r))
            moved.push_back({s.rig.fade(r), s.paths[frame_ - 1][r].at(1.0),
                             s.rig.regions()[r].role == Role::Pin});
    return moved;
}

std::vector<Eigen::Vector3d> Session::samples_by(const FieldChoice& field) const
{
    check_memory_of(field);
    const Rig& rig = state_->rig;
    std::vector<Eigen::Vector3d> samples = rest_.samples;
    carry(fit_field(field, rig.body().cells, rig.poses(), rig.constraints(),
                    moved_regions()),
          rig.rest().frame, rig.rest().samples, rig.body().cell_of_sample, {samples});
    return samples;
}

void Session::move_samples(FrameReport& report)
{
    StageState& s = *state_;
    const WorkFrame& frame = s.rig.rest().frame;
    Clock::time_point start = Clock::now();
    if (!s.fitter)
        s.fitter.emplace(settings_.field, s.rig.body().cells, s.rig.constraints(),
                         frame_ < handles_.stages[stage_].frames.size());
    std::optional<Field> field =
        s.fitter->fit(s.rig.poses(), moved_regions(), settings_.stop);
    if (!field)
    {
        report.solve.stop = Stop::Stopped;
        return;
    }
    s.field = std::make_unique<Field>(std::move(*field));
    const FieldKind kind = settings_.field.kind;
    ++(kind == FieldKind::Rbf         ? parts_.rbf
       : kind == FieldKind::RbfGlobal ? parts_.rbf_global
                                      : parts_.blend);
    report.fit_ms = ms_since(start);

    start = Clock::now();
    patch_ = rest_;
    const std::vector<Eigen::Vector3d> displacements =
        carry(*s.field, frame, s.rig.rest().samples, s.rig.body().cell_of_sample,
              {patch_.samples,
               {use_samples_, patch_.directions},
               {model_.geometry.tangent_samples, patch_.tangents},
               {model_.geometry.rotation_samples, patch_.rotations}});
    parts_.normals +=
        !rest_.directions.empty() || !rest_.tangents.empty() || !rest_.rotations.empty();
    report.apply_ms = ms_since(start);

    const double diagonal = frame.diagonal();
    for (std::size_t r = 0; r < s.rig.regions().size(); ++r)
    {
        if (!s.rig.regions()[r].prescribes())
            continue;
        const Motion motion = s.paths[frame_ - 1][r].at(1.0);
        for (const std::uint32_t i : s.rig.regions()[r].samples)
        {
            const Eigen::Vector3d& x = s.rig.rest().samples[i];
            const Eigen::Vector3d wanted =
                (motion.R - Eigen::Matrix3d::Identity()) * x + motion.t;
            report.handle_residual = std::max(
                report.handle_residual, (displacements[i] - wanted).norm() / diagonal);
        }
    }
}

void Session::commit()
{
    if (settings_.keeps_fields)
        committed_fields_.push_back(stored_field(state_->rig, *state_->field));
    rest_ = patch_;
}

FieldFile Session::field_file() const
{
    FieldFile file{committed_fields_};
    file.stages.push_back(stored_field(state_->rig, *state_->field));
    return file;
}

std::optional<Volume> Session::volume() const
{
    if (!is_closed(model_.geometry))
        return std::nullopt;
    return Volume{enclosed_volume(model_.geometry, model_.geometry.samples),
                  enclosed_volume(model_.geometry, patch_.samples)};
}

} // namespace cellwarp
