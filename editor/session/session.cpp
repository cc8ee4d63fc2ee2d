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

#include "io/error.h"
#include "io/number.h"

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

/// Steps of all regions that differ by no more are one rigid motion.
constexpr double kSameStep = 1e-12;

/// What counts as zero against the forces that cancel; see interface of --json.
constexpr double kUncancelledShare = 1e-3;

/// Regions whose stiffness differs by more than this get a warning.
constexpr double kExtremeContrast = 1e12;

/// A handle that travels farther than this gets a warning [diagonal].
constexpr double kExtremeMove = 100.0;

bool agree(const Motion& a, const Motion& b, double scale)
{
    return (a.R - b.R).norm() <= kSameStep && (a.t - b.t).norm() <= kSameStep * scale;
}

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
    StageState(Body built, Units in_units) : body(std::move(built)), units(in_units) {}

    Body body;
    Units units;
    std::vector<Region> regions;
    std::vector<int> region_of_cell;
    std::vector<Constraint> constraints;
    std::vector<Component> components;
    Glue glue;
    std::optional<Minimizer> minimizer;
    std::optional<MotionSpread> spread;
    std::vector<Pose> poses;
    SolveReport last_solve;
    std::vector<Eigen::Vector3d> box_low, box_high; ///< of each region's samples [work]
    std::vector<std::optional<RegionFade>> fades;
    struct Overlap
    {
        std::size_t a, b;
        std::uint32_t sample;
    };
    std::vector<Overlap> overlaps;
    /// Frames as motions: paths[frame][region].
    std::vector<std::vector<Path>> paths;
    std::vector<int> num_parts;
    std::unique_ptr<Field> field;
};

Session::~Session() = default;
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;

const Field* Session::field() const
{
    return state_ ? state_->field.get() : nullptr;
}

StageView Session::stage() const
{
    if (!state_)
        return {};
    return {&state_->body, &state_->regions, &state_->region_of_cell, &state_->poses};
}

Session::Session(GeometryFile model, HandleFile handles, SessionSettings settings)
    : model_(std::move(model)), handles_(std::move(handles)),
      settings_(std::move(settings))
{
    const Geometry& geometry = model_.geometry;
    rest_ = geometry.samples;
    uses_ = direction_uses(geometry);
    for (const DirectionUse& use : uses_)
        rest_directions_.push_back(geometry.directions[use.direction]);
    patch_ = {rest_, rest_directions_};
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
    Body body = build_body(model_.geometry, rest_, settings_.cells);
    parts_.interior += body.material.method != InsideMethod::None;
    for (const std::string& warning : body.warnings)
        warnings_.push_back(warning);
    const Units units{body.frame, handles_.is_relative, bounding_box(rest_)};
    state_ = std::make_unique<StageState>(std::move(body), units);
    StageState& s = *state_;
    s.regions =
        resolve_regions(statements.regions, model_.geometry, rest_, units, handles_.path);
    const std::vector<RegionShares> shares = region_shares(
        s.regions, s.body.material.grid, s.body.pieces, s.body.frame, s.body.samples);
    for (std::size_t r = 0; r < s.regions.size(); ++r)
        if (s.regions[r].samples.empty() && shares[r].cells.empty())
            throw malformed({handles_.path, s.regions[r].line, s.regions[r].name},
                            "selects nothing of the model" +
                                nearest_sample_note(s.regions[r], rest_));
    const std::size_t num_cells = s.body.cells.size();
    s.region_of_cell = prescribing_regions(s.regions, shares, num_cells, handles_.path);
    const std::vector<double> factors = cell_factors(s.regions, shares, num_cells);
    const auto [softest, stiffest] = std::minmax_element(factors.begin(), factors.end());
    if (!factors.empty() && *stiffest > kExtremeContrast * *softest)
        warnings_.push_back(
            fmt::format("stiffness differs by a factor of {:.1g}: the soft "
                        "parts keep few digits",
                        *stiffest / *softest));
    s.glue = build_glue(s.body.cells, factors);

    measure_regions(shares);
    hold_cells(shares);
    place_fades();
    for (const Cell& cell : s.body.cells.cells)
        s.poses.push_back({Eigen::Matrix3d::Identity(), cell.centre});
    if (settings_.field == FieldKind::RbfGlobal && settings_.cells.max_memory > 0)
    {
        std::vector<int> all(s.body.cells.size());
        std::iota(all.begin(), all.end(), 0);
        const std::size_t centres = CentreChoice(s.body.cells, s.poses, s.constraints)
                                        .centres_of(all)
                                        .points.size();
        const double bytes = RbfField::memory_estimate(centres);
        if (bytes > settings_.cells.max_memory)
            throw Error(
                Fault::Budget,
                fmt::format("the global release field of {} centres needs {} (limit "
                            "{}): the local one, rbf, needs less",
                            centres, in_bytes(bytes),
                            in_bytes(settings_.cells.max_memory)));
    }
    plan_frames(statements.frames);
}

/// Boxes of the regions' samples, and which samples two of them share.
void Session::measure_regions(const std::vector<RegionShares>& shares)
{
    StageState& s = *state_;
    // Boxes of the regions' samples: centres of rotation, and how far they travel.
    for (const Region& region : s.regions)
    {
        Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY), high = -low;
        for (const std::uint32_t i : region.samples)
        {
            low = low.cwiseMin(s.body.samples[i]);
            high = high.cwiseMax(s.body.samples[i]);
        }
        const std::size_t r = s.box_low.size();
        if (region.samples.empty())
            for (const auto& [cell, share] : shares[r].cells)
            {
                const Eigen::Vector3d& centre =
                    s.body.cells.cells[static_cast<std::size_t>(cell)].centre;
                low = low.cwiseMin(centre);
                high = high.cwiseMax(centre);
            }
        s.box_low.push_back(low);
        s.box_high.push_back(high);
    }

    // Samples of two regions: their motions must agree in every frame.
    std::vector<int> first_region(rest_.size(), -1);
    for (std::size_t r = 0; r < s.regions.size(); ++r)
        for (const std::uint32_t i : s.regions[r].samples)
        {
            if (!s.regions[r].prescribes())
                break;
            if (first_region[i] >= 0)
                s.overlaps.push_back({static_cast<std::size_t>(first_region[i]), r, i});
            else
                first_region[i] = static_cast<int>(r);
        }
}

/// What each cell is held by, and the equations that follow.
void Session::hold_cells(const std::vector<RegionShares>& shares)
{
    StageState& s = *state_;
    s.constraints.resize(s.body.cells.size());
    for (std::size_t c = 0; c < s.constraints.size(); ++c)
    {
        const int owner = s.region_of_cell[c];
        if (owner < 0)
            continue;
        const Region& region = s.regions[static_cast<std::size_t>(owner)];
        s.constraints[c].hold =
            region.role == Role::Pin ? Hold::Pinned : Hold::Prescribed;
        s.constraints[c].held_rest = s.body.cells.cells[c].centre;
    }
    // A pinned cell is held at the mean of the pin's samples in it. One without any
    // is held at its centre if most of it is the pin's, else, being a neighbour of a
    // small pin, where the pin's nearest sample is.
    for (std::size_t r = 0; r < s.regions.size(); ++r)
    {
        const Region& region = s.regions[r];
        if (region.role != Role::Pin || region.samples.empty())
            continue;
        std::map<int, std::pair<Eigen::Vector3d, int>> sums;
        for (const std::uint32_t i : region.samples)
        {
            auto [found, is_new] =
                sums.try_emplace(s.body.cell_of_sample[i], Eigen::Vector3d::Zero(), 0);
            found->second.first += s.body.samples[i] - s.box_low[r];
            ++found->second.second;
        }
        for (const auto& [cell, share] : shares[r].cells)
        {
            const std::size_t c = static_cast<std::size_t>(cell);
            if (s.region_of_cell[c] != static_cast<int>(r))
                continue;
            Eigen::Vector3d& held = s.constraints[c].held_rest;
            const auto found = sums.find(cell);
            if (found != sums.end())
                held = s.box_low[r] + found->second.first / found->second.second;
            else if (share < 0.5)
                held = s.body.samples[*std::min_element(
                    region.samples.begin(), region.samples.end(),
                    [&](std::uint32_t a, std::uint32_t b)
                    {
                        return (s.body.samples[a] - held).squaredNorm() <
                               (s.body.samples[b] - held).squaredNorm();
                    })];
        }
    }
    for (Constraint& constraint : s.constraints)
        constraint.held_now = constraint.held_rest;
    s.components = find_components(s.body.cells, s.constraints);
    const std::size_t num_idle = static_cast<std::size_t>(
        std::count_if(s.components.begin(), s.components.end(),
                      [](const Component& component) { return !component.is_held; }));
    if (num_idle > 0)
        warnings_.push_back(
            fmt::format("{} of {} components have no region: they stay at rest", num_idle,
                        s.components.size()));
    for (const Component& component : s.components)
        if (component.free_rotations > 0)
            warnings_.push_back(
                fmt::format("a component of {} cells is held by {} alone: {} of its "
                            "rotations are free and "
                            "are kept as they are",
                            component.cells.size(),
                            component.free_rotations == 3 ? "one pin" : "pins in a line",
                            component.free_rotations));
    const auto check_memory = [&](const char* what, double bytes)
    {
        if (settings_.cells.max_memory > 0 && bytes > settings_.cells.max_memory)
            throw Error(Fault::Budget,
                        fmt::format("the {} of {} cells need about {} (limit {}): a "
                                    "smaller --across or --max-depth needs less",
                                    what, s.body.cells.size(), in_bytes(bytes),
                                    in_bytes(settings_.cells.max_memory)));
    };
    check_memory("equations", Multigrid::memory_estimate(s.body.cells.size(),
                                                         s.body.cells.faces.size()));
    s.minimizer.emplace(s.body.cells, s.glue, s.constraints, s.components);
    if (settings_.method == Method::GaussNewtonDirect)
        check_memory("factors", s.minimizer->factor_bytes());
    s.spread.emplace(s.body.cells, s.glue, s.constraints, s.region_of_cell,
                     static_cast<int>(s.regions.size()));
}

/// Where the regions' corrections act: around their samples, and around the borders of
/// their cells, where the field knows the motion too. Without these what lies just
/// outside would depend on how near the last sample of the region happens to be.
void Session::place_fades()
{
    StageState& s = *state_;
    const std::vector<std::vector<Eigen::Vector3d>> borders =
        border_points(s.body.cells, s.constraints);
    for (std::size_t r = 0; r < s.regions.size(); ++r)
    {
        const Region& region = s.regions[r];
        std::optional<RegionFade>& fade = s.fades.emplace_back();
        if (!region.prescribes() || region.samples.empty())
            continue;
        std::vector<RegionFade::Node> samples, further;
        for (const std::uint32_t i : region.samples)
            samples.push_back({s.body.samples[i], s.body.cell_of_sample[i]});
        for (std::size_t c = 0; c < s.constraints.size(); ++c)
            if (s.region_of_cell[c] == static_cast<int>(r) &&
                s.constraints[c].hold == Hold::Prescribed)
                for (const Eigen::Vector3d& point : borders[c])
                    further.push_back({point, static_cast<int>(c)});
        fade.emplace(s.body.cells, samples, further);
    }
}

/// All frames as paths, so that a wrong one fails before the first is solved.
void Session::plan_frames(const std::vector<FrameStatement>& frames)
{
    StageState& s = *state_;
    std::vector<std::vector<Step>> now(s.regions.size());
    for (const FrameStatement& frame : frames)
    {
        std::vector<Path>& paths = s.paths.emplace_back();
        std::vector<Motion> motions;
        std::map<std::string, const Move*> moves;
        for (const Move& move : frame.moves)
            moves[move.region] = &move;
        int parts = 1;
        for (std::size_t r = 0; r < s.regions.size(); ++r)
        {
            const auto found = moves.find(s.regions[r].name);
            const Move* move = found == moves.end() ? nullptr : found->second;
            std::vector<Step> next = now[r];
            if (move)
            {
                const Eigen::Vector3d centre = 0.5 * (s.box_low[r] + s.box_high[r]);
                const bool is_placed = std::any_of(
                    move->operations.begin(), move->operations.end(),
                    [](const Operation& o) { return o.kind == Operation::Kind::To; });
                if (is_placed && (s.box_high[r] - s.box_low[r]).norm() >
                                     1e-9 * s.body.frame.diagonal())
                    throw malformed({handles_.path, move->line, move->region},
                                    "'to' needs a pin of one place; this one has " +
                                        std::to_string(s.regions[r].samples.size()) +
                                        " samples, use translate");
                next = steps_of(*move, s.units, centre, s.box_low[r], handles_.path,
                                warnings_);
            }
            const Path path = paths.emplace_back(now[r], next);
            now[r] = std::move(next);
            motions.push_back(path.at(1.0));
            if (s.regions[r].prescribes())
            {
                parts = std::max(parts, path.num_parts(s.box_low[r], s.box_high[r],
                                                       s.body.frame.diagonal()));
                const Eigen::Vector3d centre = 0.5 * (s.box_low[r] + s.box_high[r]);
                if (s.body.frame.diagonal() > 0 &&
                    (motions.back()(centre) - centre).norm() >
                        kExtremeMove * s.body.frame.diagonal())
                    warnings_.push_back(fmt::format("frame {}: {} moves by more than {} "
                                                    "diagonals: the shape is stretched "
                                                    "to an extreme",
                                                    frame.number, s.regions[r].name,
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
    for (const StageState::Overlap& overlap : s.overlaps)
    {
        const Eigen::Vector3d& x = s.body.samples[overlap.sample];
        const double apart = (motions[overlap.a](x) - motions[overlap.b](x)).norm();
        const double scale =
            std::max(s.body.frame.diagonal(), motions[overlap.a](x).norm());
        if (!(apart <= kSameMotion * scale))
            throw malformed(
                {handles_.path, line, s.regions[overlap.a].name},
                fmt::format("and {} (line {}) both hold sample {} and move it "
                            "differently ({:.3g} of the diagonal apart)",
                            s.regions[overlap.b].name, s.regions[overlap.b].line,
                            overlap.sample, apart / s.body.frame.diagonal()));
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
    report.solve_ms = ms_since(start);
    ++frame_;
    const bool is_committed =
        frame_ == stage.frames.size() && stage_ + 1 < handles_.stages.size();
    if (wants_samples || is_committed)
        move_samples(report);
    return true;
}

std::vector<Motion> Session::set_motions(double t)
{
    StageState& s = *state_;
    std::vector<Motion> motions;
    for (const Path& path : s.paths[frame_])
        motions.push_back(path.at(t));
    for (std::size_t c = 0; c < s.constraints.size(); ++c)
    {
        const int owner = s.region_of_cell[c];
        if (owner < 0)
            continue;
        const Motion& motion = motions[static_cast<std::size_t>(owner)];
        Constraint& constraint = s.constraints[c];
        const Eigen::Vector3d& centre = s.body.cells.cells[c].centre;
        if (constraint.hold == Hold::Prescribed)
            s.poses[c] = carried(motion, centre);
        else if (constraint.hold == Hold::Pinned)
        {
            constraint.held_now = constraint.held_rest + motion.t;
            s.poses[c] = held_at_pin(s.poses[c], constraint, centre);
        }
    }
    s.minimizer->set_held_points(s.constraints);
    return motions;
}

/// The one rigid step that all regions of a component make, if they do. A pin takes part
/// if the step takes its held points where they must be.
std::optional<Motion> Session::rigid_step_of(const Component& component,
                                             const std::vector<Motion>& last,
                                             const std::vector<Motion>& steps) const
{
    const StageState& s = *state_;
    std::optional<Motion> step;
    for (const bool is_pin : {false, true})
        for (const int cell : component.cells)
        {
            const std::size_t c = static_cast<std::size_t>(cell);
            const int owner = s.region_of_cell[c];
            if (owner < 0 || (s.constraints[c].hold == Hold::Pinned) != is_pin)
                continue;
            const std::size_t r = static_cast<std::size_t>(owner);
            if (!step)
                step = steps[r];
            const double scale = std::max(1.0, steps[r].t.norm());
            const bool agrees = is_pin
                                    ? ((*step)(s.constraints[c].held_rest + last[r].t) -
                                       s.constraints[c].held_now)
                                              .norm() <= kSameStep * scale
                                    : agree(*step, steps[r], scale);
            if (!agrees)
                return std::nullopt;
        }
    return step;
}

/// Where the free cells start from: a component whose regions all make one rigid step
/// makes it as a whole; in others each cell takes its part in them.
void Session::carry_steps(const std::vector<Motion>& last,
                          const std::vector<Motion>& motions)
{
    StageState& s = *state_;
    std::vector<Motion> steps;
    for (std::size_t r = 0; r < motions.size(); ++r)
        steps.push_back(motions[r] * inverse(last[r]));
    for (const Component& component : s.components)
    {
        if (!component.is_held)
            continue;
        const std::optional<Motion> rigid = rigid_step_of(component, last, steps);
        if (rigid && rigid->R.isIdentity(0) && rigid->t.isZero(0))
            continue;
        std::vector<int> cells;
        for (const int cell : component.cells)
            if (s.constraints[static_cast<std::size_t>(cell)].hold != Hold::Prescribed)
                cells.push_back(cell);
        if (!rigid)
            s.spread->carry(steps, cells, s.poses);
        for (const int cell : cells)
        {
            const std::size_t c = static_cast<std::size_t>(cell);
            Pose& pose = s.poses[c];
            if (rigid)
                pose = {rigid->R * pose.R, (*rigid)(pose.p)};
            if (s.constraints[c].hold == Hold::Pinned)
                pose = held_at_pin(pose, s.constraints[c], s.body.cells.cells[c].centre);
        }
    }
}

void Session::solve_frame(FrameReport& report)
{
    StageState& s = *state_;
    const Clock::time_point start = Clock::now();
    const int parts = s.num_parts[frame_];
    std::vector<Motion> last;
    bool is_moved = false;
    for (const Path& path : s.paths[frame_])
    {
        last.push_back(path.at(0.0));
        const Motion now = path.at(1.0);
        is_moved = is_moved || now.R != last.back().R || now.t != last.back().t;
    }
    // The last solution stands, and is not polished to other bits.
    if (!is_moved && frame_ > 0 && s.last_solve.stop == Stop::Converged)
    {
        s.last_solve.iterations = s.last_solve.linear_steps = 0;
        s.last_solve.energy_before = s.last_solve.energy_after;
        report.solve = s.last_solve;
        report.max_pair_gap = largest_gap();
        return;
    }
    SolveReport total;
    double gradient_scale = 0.0;
    bool is_given_up = false;
    for (int part = 1; part <= parts; ++part)
    {
        // Out of time on the way: straight to the end.
        const bool is_last = part == parts || is_given_up;
        std::vector<Motion> motions =
            set_motions(is_last ? 1.0 : static_cast<double>(part) / parts);
        // The frame's scale, before any guess makes its first gradient small.
        if (part == 1)
        {
            const Residual first = s.minimizer->residual(s.poses);
            gradient_scale =
                std::max(first.gradient, kUncancelledShare * first.uncancelled);
        }
        const double energy_before = glue_energy(s.glue, s.poses);
        carry_steps(last, motions);

        SolveOptions options;
        options.method = settings_.method;
        options.max_iterations =
            is_last ? settings_.max_iterations
                    : std::min(settings_.max_iterations, kTravelIterations);
        options.gradient_tolerance =
            is_last ? settings_.gradient_tolerance : kTravelTolerance;
        options.gradient_scale = gradient_scale;
        options.stop = settings_.stop;
        if (settings_.time_budget > 0)
            options.time_budget =
                std::max(1e-9, settings_.time_budget - 1e-3 * ms_since(start));
        SolveReport solve = s.minimizer->minimize(s.poses, options);
        solve.iterations += std::max(0, total.iterations);
        solve.linear_steps += total.linear_steps;
        solve.damped_factorisations += total.damped_factorisations;
        solve.backward_error = std::max(solve.backward_error, total.backward_error);
        solve.energy_before = energy_before;
        total = solve;
        ++report.steps;
        if (is_last)
            break;
        is_given_up = solve.stop == Stop::TimeLimit || solve.stop == Stop::Stopped;
        last = std::move(motions);
    }
    report.solve = s.last_solve = total;
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
    report.max_pair_gap = largest_gap();
}

/// Between glued cells [diagonal].
double Session::largest_gap() const
{
    const StageState& s = *state_;
    double largest = 0.0;
    for (const GlueFace& face : s.glue.faces)
        largest =
            std::max(largest, glue_energy(face, s.poses[static_cast<std::size_t>(face.a)],
                                          s.poses[static_cast<std::size_t>(face.b)]) /
                                  face.stiffness);
    return std::sqrt(largest) / s.body.frame.diagonal();
}

void Session::move_samples(FrameReport& report)
{
    StageState& s = *state_;
    const WorkFrame& frame = s.body.frame;
    Clock::time_point start = Clock::now();
    std::vector<MovedRegion> moved;
    std::vector<Motion> motions;
    for (std::size_t r = 0; r < s.regions.size(); ++r)
    {
        motions.push_back(s.paths[frame_ - 1][r].at(1.0));
        if (!s.fades[r])
            continue;
        moved.push_back({&*s.fades[r], motions[r], s.regions[r].role == Role::Pin, {}});
    }
    s.field = std::make_unique<Field>(settings_.field, s.body.cells, s.poses,
                                      s.constraints, std::move(moved));
    ++(settings_.field == FieldKind::Rbf         ? parts_.rbf
       : settings_.field == FieldKind::RbfGlobal ? parts_.rbf_global
                                                 : parts_.blend);
    report.fit_ms = ms_since(start);

    start = Clock::now();
    const std::vector<Eigen::Vector3d> displacements =
        s.field->displacements(s.body.samples, s.body.cell_of_sample);
    patch_.samples.resize(rest_.size());
    for (std::size_t i = 0; i < rest_.size(); ++i)
        patch_.samples[i] = rest_[i] + frame.vector_to_model(displacements[i]);
    patch_.directions = rest_directions_;
    for (std::size_t u = 0; u < uses_.size(); ++u)
    {
        const std::uint32_t i = uses_[u].sample;
        const Eigen::Matrix3d gradient =
            s.field->value(s.body.samples[i], s.body.cell_of_sample[i]).gradient;
        if (gradient.isZero(0))
            continue;
        const Eigen::Matrix3d J =
            Eigen::Matrix3d::Identity() + frame.axes.transpose() * gradient * frame.axes;
        patch_.directions[u] = turned_normal(J, rest_directions_[u]);
    }
    parts_.normals += !uses_.empty();
    report.apply_ms = ms_since(start);

    const double diagonal = frame.diagonal();
    for (std::size_t r = 0; r < s.regions.size(); ++r)
        for (const std::uint32_t i : s.regions[r].samples)
        {
            if (!s.regions[r].prescribes())
                break;
            const Eigen::Vector3d& x = s.body.samples[i];
            const Eigen::Vector3d wanted =
                (motions[r].R - Eigen::Matrix3d::Identity()) * x + motions[r].t;
            report.handle_residual = std::max(
                report.handle_residual, (displacements[i] - wanted).norm() / diagonal);
        }
}

void Session::commit()
{
    rest_ = patch_.samples;
    rest_directions_ = patch_.directions;
}

std::optional<Volume> Session::volume() const
{
    if (!is_closed(model_.geometry))
        return std::nullopt;
    return Volume{enclosed_volume(model_.geometry, model_.geometry.samples),
                  enclosed_volume(model_.geometry, patch_.samples)};
}

} // namespace cellwarp
