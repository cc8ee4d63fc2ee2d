// SPDX-License-Identifier: GPL-3.0-or-later
// One stage lasts from the start, or a commit, to the next commit: its cells,
// regions and frames.
#include "library/session/session.h"

#include <algorithm>
#include <cassert>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "library/session/apply_field.h"
#include "library/session/deformation.h"
#include "library/session/flat.h"
#include "library/session/half_turn_ways.h"
#include "library/session/holding_warnings.h"
#include "library/session/memory_limit.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

/// More cells at the depth limit than this get a warning [cells].
constexpr double kManyAtLimit = 0.02;

std::optional<CellContactReport> contact_report(const CellSystem& system)
{
    if (!system.rest().boundary)
        return std::nullopt;
    CellContactReport report;
    for (const FoundContact& found : system.contacts())
    {
        ++report.points;
        report.deepest =
            std::max(report.deepest, found.depth / system.rest().frame.diagonal());
    }
    return report;
}

/// Of the pins of several places.
std::vector<PinReport> pin_reports(const CellSystem& system)
{
    std::vector<PinReport> pins;
    for (std::size_t r = 0; r < system.regions().size(); ++r)
    {
        if (!system.regions()[r].turns_freely())
            continue;
        const Motion motion = system.rest().frame.motion_to_model(system.motions()[r]);
        PinReport& pin = pins.emplace_back();
        pin.name = system.regions()[r].name;
        pin.motion.setIdentity();
        pin.motion.topLeftCorner<3, 3>() = motion.R;
        pin.motion.topRightCorner<3, 1>() = motion.t;
        pin.degrees = rotation_vector(motion.R).norm() * 180.0 / std::numbers::pi;
    }
    return pins;
}

/// What factors of earlier fits may take [byte]: they are made anew where others need
/// the memory.
std::size_t most_for_systems(const SessionSettings& settings)
{
    constexpr double kShare = 0.2; // of the limit
    const double limit = settings.cells.max_memory;
    return limit > 0.0 ? std::min(RbfSystems::kMostBytes,
                                  static_cast<std::size_t>(kShare * limit))
                       : RbfSystems::kMostBytes;
}

} // namespace

/// Everything that belongs to one stage.
struct Session::StageState
{
    StageState(std::shared_ptr<const StageStart> of_stage, CellSystem in_cells)
        : start(std::move(of_stage)), refiner(start->refiner),
          system(std::move(in_cells)), aims(rest_aims(system.regions()))
    {
    }

    std::shared_ptr<const StageStart> start;
    CellRefiner refiner;
    CellSystem system;
    StageAims aims; ///< at the end of the last frame
    FramePlan plan; ///< of the frame that is solved
    SolveReport last_solve;
    std::optional<FieldFitter> fitter; ///< of the system's cells
    std::unique_ptr<Field> field;
};

Session::~Session() = default;
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;

const Field* Session::field() const
{
    return state_ ? state_->field.get() : nullptr;
}

const CellSystem* Session::system() const
{
    return state_ ? &state_->system : nullptr;
}

std::map<std::string, Eigen::Vector3d> Session::borders() const
{
    const StageStart& start = *state_->start;
    std::map<std::string, Eigen::Vector3d> borders;
    for (std::size_t r = 0; r < start.borders.size(); ++r)
        // A region without glue has none: its centre stands for it.
        if (start.borders[r] != start.regions->centre(r))
            borders.emplace((*start.regions)[r].name,
                            rest_->shape->frame.to_model(start.borders[r]));
    return borders;
}

CellRefiner Session::refiner() const
{
    return state_->refiner;
}

Session::Session(Geometry geometry, HandleFile handles, SessionSettings settings)
    : Session(std::make_shared<const Geometry>(std::move(geometry)), std::move(handles),
              std::move(settings))
{
}

Session::Session(std::shared_ptr<const Geometry> of, HandleFile handles,
                 SessionSettings settings, std::shared_ptr<const RestShape> shape)
    : geometry_(std::move(of)), first_shape_(std::move(shape)),
      settings_(std::move(settings)),
      rbf_systems_(std::make_unique<RbfSystems>(most_for_systems(settings_)))
{
    const Geometry& geometry = *geometry_;
    DeformedSamples first{geometry.samples, {}, geometry.tangents, geometry.rotations};
    for (const DirectionUse& use : direction_uses(geometry))
    {
        first.directions.push_back(geometry.directions[use.direction]);
        use_samples_.push_back(use.sample);
    }
    parts_.faces = geometry.num_faces() > 0;
    warnings_ = geometry.warnings;
    if (settings_.keeps_checkpoints)
    {
        deformed_ = std::make_shared<const DeformedSamples>(std::move(first));
        set_script(std::move(handles));
        return;
    }
    handles_ = std::move(handles);
    script_ = ScriptFingerprint(handles_);
    const bool has_frames =
        std::any_of(handles_.stages.begin(), handles_.stages.end(),
                    [](const Stage& stage) { return !stage.frames.empty(); });
    if (!has_frames)
    {
        deformed_ = std::make_shared<const DeformedSamples>(std::move(first));
        warnings_.push_back("no frame: nothing moves, the samples stay where they are");
        stage_ = handles_.stages.size();
        return;
    }
    start_stage(make_rest(0, std::move(first)));
}

CellSystemSettings Session::system_settings() const
{
    return {settings_.cells.max_memory, settings_.method, settings_.departures,
            settings_.cells.loose_follow};
}

std::shared_ptr<const StageRest>
Session::make_rest(std::size_t stage, DeformedSamples samples,
                   std::vector<std::shared_ptr<const StoredField>> fields)
{
    auto rest = std::make_shared<StageRest>();
    rest->stage = stage;
    rest->fingerprint = script_.before(stage);
    rest->samples = std::move(samples);
    rest->fields = std::move(fields);
    CellSettings cells = settings_.cells;
    if (!cells.is_flat && settings_.led_rods.empty())
        rest->plane = DefaultPlane::of(rest->samples.samples, cells);
    cells.is_flat = is_to_be_flat(*rest);
    rest->shape = std::exchange(first_shape_, nullptr);
    if (!rest->shape || rest->shape->is_flat() != *cells.is_flat)
        rest->shape = build_rest_shape(*geometry_, rest->samples.samples, cells);
    parts_.interior += rest->shape->material.method != InsideMethod::None;
    return rest;
}

/// As the statements are now.
bool Session::is_to_be_flat(const StageRest& rest) const
{
    return settings_.cells.is_flat.value_or(
        rest.plane &&
        rest.plane->keeps(handles_.stages[rest.stage], handles_.is_relative));
}

bool Session::fits(const StageRest& rest) const
{
    return rest.shape->is_flat() == is_to_be_flat(rest);
}

std::shared_ptr<const DeformedSamples> Session::samples_at_rest() const
{
    return {rest_, &rest_->samples};
}

void Session::start_stage(std::shared_ptr<const StageRest> rest)
{
    state_.reset();
    if (rest != rest_)
        rbf_systems_->clear(); // of cells that are not made again
    rest_ = std::move(rest);
    stage_ = rest_->stage;
    frame_ = 0;
    const RestShape& shape = *rest_->shape;
    const std::vector<Eigen::Vector3d>& samples = rest_->samples.samples;
    warnings_.insert(warnings_.end(), shape.warnings.begin(), shape.warnings.end());
    const Units units{shape.frame, handles_.is_relative, bounding_box(samples),
                      shape.material.grid.shape().edge};
    const Stage& stage = handles_.stages[stage_];
    std::vector<Region> resolved = resolve_regions(
        stage.regions, *geometry_, samples, units, handles_, nullptr, settings_.led_rods);
    if (shape.is_flat())
        for (const Region& region : resolved)
            if (region.spline)
                throw malformed(
                    {handles_.path, region.line, region.name},
                    "a flat model (cells.flat) has regions alone, no rods and "
                    "curves");
    put_on_guides(stage.ons, handles_.path, resolved);
    std::shared_ptr<const SkeletonHandle> skeleton;
    SkeletonBinding binding;
    if (!stage.joints.empty())
    {
        skeleton =
            std::make_shared<const SkeletonHandle>(stage.joints, units, handles_.path);
        for (Region& bone : bone_regions(*skeleton, shape, binding))
            resolved.push_back(std::move(bone));
        ++parts_.skeleton;
    }
    const auto regions = std::make_shared<const RegionSet>(
        rest_->shape, std::move(resolved), handles_.path, skeleton);
    binding.outside = regions->outside();
    std::erase_if(binding.bones,
                  [&](const BoneBinding& bone)
                  {
                      return std::find(binding.outside.begin(), binding.outside.end(),
                                       bone.name) != binding.outside.end();
                  });
    for (std::string& warning : binding_warnings(binding, handles_.path))
        warnings_.push_back(std::move(warning));
    if (shape.is_flat() && regions->skeleton())
        throw malformed({handles_.path, 0, "skeleton"},
                        "a flat model (cells.flat) has regions alone, no skeleton");
    const auto start = std::make_shared<StageStart>(
        StageStart{rest_,
                   regions,
                   units,
                   CellRefiner(rest_->shape, regions, settings_.cells, system_settings()),
                   {},
                   std::move(binding)});
    CellSystem system = start->refiner.first();
    start->borders = system.region_borders();
    for (std::string& warning : start->refiner.take_warnings())
        warnings_.push_back(std::move(warning));
    for (std::string& warning : holding_warnings(system, handles_.path))
        warnings_.push_back(std::move(warning));
    for (const Region& region : regions->regions())
        parts_.rods += region.spline != nullptr;
    state_ = std::make_unique<StageState>(start, std::move(system));
    warn_of_bones();
    check_memory_of(settings_.field);
    check_frames();
    deformed_ = samples_at_rest();
    is_deformed_current_ = true;
    add_checkpoint();
}

void Session::set_script(HandleFile handles)
{
    assert(settings_.keeps_checkpoints);
    stopped_.reset();
    ScriptFingerprint script(handles);
    const ScriptPlace here{stage_, frame_};
    const bool goes_on =
        state_ && script.has(here) && script.up_to(here) == script_.up_to(here);
    handles_ = std::move(handles);
    script_ = std::move(script);
    try
    {
        if (goes_on && fits(*rest_))
            check_frames();
        else
            go_back();
        if (!upcoming_frame())
        {
            commit_to_end();
            if (!is_deformed_current_)
                update_samples();
        }
    }
    catch (...)
    {
        state_.reset();
        throw;
    }
}

/// To the last state that the statements pass through: the end of a frame, or the start
/// of a stage whose rest shape is there, or is there but for what it is made of: moves
/// tell whether it is flat.
void Session::go_back()
{
    if (!first_rest_)
        first_rest_ = make_rest(0, *deformed_);
    const bool has_last = last_rest_ && last_rest_->stage < script_.num_stages() &&
                          script_.before(last_rest_->stage) == last_rest_->fingerprint;
    std::shared_ptr<const StageRest> rest = has_last ? last_rest_ : first_rest_;
    const Checkpoint* const kept = checkpoints_.latest_on(script_);
    if (kept && kept->place.stage >= rest->stage)
    {
        if (fits(*kept->start->rest))
        {
            go_to(*kept);
            return;
        }
        rest = kept->start->rest;
    }
    if (!fits(*rest))
    {
        rest = make_rest(rest->stage, rest->samples, rest->fields);
        (rest->stage == 0 ? first_rest_ : last_rest_) = rest;
    }
    warnings_ = geometry_->warnings;
    reports_.clear();
    frames_done_ = 0;
    for (std::size_t s = 0; s < rest->stage; ++s)
        frames_done_ += handles_.stages[s].frames.size();
    start_stage(rest);
}

Checkpoint Session::checkpoint() const
{
    const StageState& s = *state_;
    Checkpoint here{script_.up_to({stage_, frame_}),
                    {stage_, frame_},
                    s.start,
                    s.system.body().octree,
                    s.system.state(),
                    s.aims,
                    s.last_solve,
                    std::nullopt,
                    warnings_,
                    frames_done_,
                    s.system.shared_body()};
    if (frame_ > 0)
        here.report = reports_.back();
    return here;
}

/// Sets all but the state of the stage, which make_state() makes.
void Session::leave_for(const Checkpoint& to)
{
    state_.reset();
    rest_ = to.start->rest;
    stage_ = to.place.stage;
    frame_ = to.place.frame;
    warnings_ = to.warnings;
    frames_done_ = to.frames_done;
}

void Session::make_state(const Checkpoint& at)
{
    auto state = std::make_unique<StageState>(
        at.start,
        CellSystem(at.body ? at.body
                           : std::make_shared<const Body>(cut(rest_->shape, at.octree)),
                   at.start->regions, system_settings()));
    state->system.set_state(at.system);
    state->aims = at.aims;
    state->last_solve = at.last_solve;
    state_ = std::move(state);
}

void Session::go_to(const Checkpoint& kept)
{
    leave_for(kept);
    make_state(kept);
    reports_.clear();
    if (kept.report)
        reports_.push_back(*kept.report);
    check_frames();
    is_deformed_current_ = frame_ == 0;
    if (is_deformed_current_)
        deformed_ = samples_at_rest();
}

void Session::add_checkpoint()
{
    if (!settings_.keeps_checkpoints)
        return;
    Checkpoint kept = checkpoint();
    kept.body = nullptr; // many cells take much more memory than their octree
    checkpoints_.add(std::move(kept));
}

void Session::check_memory_of(const FieldChoice& field) const
{
    if (!is_dense(field.kind))
        return;
    const CellSystem& system = state_->system;
    const std::size_t centres = centres_of_all(field.kind, system.body().cells,
                                               system.constraints(), system.poses())
                                    .points.size();
    const double bytes =
        memory_with(RbfSystem::memory_estimate(centres), settings_.cells.max_memory);
    if (settings_.cells.max_memory > 0 && bytes > settings_.cells.max_memory)
        throw Error(Fault::Budget,
                    fmt::format("the global release field of {} centres needs {} (limit "
                                "{}): the local one, rbf, needs less",
                                centres, in_bytes(bytes),
                                in_bytes(settings_.cells.max_memory)));
}

/// The way from where \p aims have the regions; they are those of the frame afterwards.
FramePlan Session::plan(const FrameStatement& frame,
                        std::span<const std::shared_ptr<const SplineState>> led,
                        StageAims& aims, std::vector<std::string>& warnings) const
{
    const CellSystem& system = state_->system;
    return plan_frame(frame, system.regions(), state_->start->borders,
                      state_->start->units, system.rest(), handles_.path, led, aims,
                      warnings);
}

/// All frames of the stage that are left, so that a wrong one fails before the next is
/// solved. Where frames may still be taken back their warnings come with their solution.
void Session::check_frames()
{
    std::vector<std::string> of_frames;
    StageAims aims = state_->aims;
    const std::vector<FrameStatement>& frames = handles_.stages[stage_].frames;
    for (std::size_t f = frame_; f < frames.size(); ++f)
        plan(frames[f], {}, aims, of_frames);
    if (!settings_.keeps_checkpoints)
        warnings_.insert(warnings_.end(), of_frames.begin(), of_frames.end());
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

std::size_t Session::num_upcoming() const
{
    std::size_t count = 0;
    for (std::size_t s = stage_; s < handles_.stages.size(); ++s)
        count += handles_.stages[s].frames.size();
    return count - std::min(count, frame_);
}

void Session::lead(std::vector<std::shared_ptr<const SplineState>> rods)
{
    led_ = std::move(rods);
}

bool Session::next_frame(bool wants_samples)
{
    if (stopped_)
    {
        make_state(*stopped_);
        stopped_.reset();
    }
    if (!state_ || !upcoming_frame())
        return false;
    struct Before
    {
        Checkpoint checkpoint;
        PartCounts parts;
        std::shared_ptr<const DeformedSamples> deformed;
        bool is_deformed_current;
    };
    const auto here = [&] {
        return Before{checkpoint(), parts_, deformed_, is_deformed_current_};
    };
    Before before = here();
    const std::size_t num_reports = reports_.size();
    const auto roll_back = [&]
    {
        rbf_systems_->clear();
        leave_for(before.checkpoint);
        parts_ = before.parts;
        deformed_ = before.deformed;
        is_deformed_current_ = before.is_deformed_current;
        reports_.resize(num_reports);
    };
    try
    {
        const Clock::time_point start = Clock::now();
        while (frame_ >= handles_.stages[stage_].frames.size())
        {
            commit();
            before = here();
        }
        solve_next(wants_samples, ms_since(start));
        led_.clear();
    }
    catch (const Stopped&)
    {
        roll_back();
        stopped_ = std::make_unique<const Checkpoint>(std::move(before.checkpoint));
        throw;
    }
    catch (...)
    {
        try
        {
            const StopDeferral deferral;
            roll_back();
            make_state(before.checkpoint);
        }
        catch (...)
        {
            state_.reset(); // no memory is left for it
        }
        throw;
    }
    return true;
}

/// \p cells_ms: what its commits took.
void Session::solve_next(bool wants_samples, double cells_ms)
{
    FrameStatement& statement = handles_.stages[stage_].frames[frame_];
    std::vector<std::string> told_before;
    state_->plan = plan(statement, led_, state_->aims,
                        settings_.keeps_checkpoints ? warnings_ : told_before);
    FrameReport& report = reports_.emplace_back();
    report.frame = statement.number;
    report.cells_ms = cells_ms;
    const Clock::time_point start = Clock::now();
    solve_frame(report);
    report.solve_ms = ms_since(start) - (report.cells_ms - cells_ms);
    end_frame(report, wants_samples);
    if (settings_.keeps_checkpoints)
    {
        statement.moves = {}; // not needed again: the next set_script() brings its own
        reports_.erase(reports_.begin(), reports_.end() - 1);
    }
}

void Session::end_frame(FrameReport& report, bool wants_samples)
{
    ++frame_;
    ++frames_done_;
    is_deformed_current_ = false;
    const bool is_committed = frame_ == handles_.stages[stage_].frames.size() &&
                              stage_ + 1 < handles_.stages.size();
    if (wants_samples || is_committed)
        move_samples(report);
    add_checkpoint();
    if (settings_.keeps_checkpoints && !upcoming_frame())
        commit_to_end();
}

void Session::solve_frame(FrameReport& report)
{
    StageState& s = *state_;
    if (s.last_solve.stop == Stop::Converged && s.plan.stands())
    {
        // The last solution stands: it is not polished to other bits.
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
        SolvedWays ways = solve_half_turns(s.system, s.refiner, s.plan, settings_,
                                           frames_done_, report);
        if (report.refinements > 0 || !s.plan.half_turns.empty())
            s.fitter.reset();
        for (std::string& warning : ways.warnings)
            warnings_.push_back(std::move(warning));
        if (ways.is_left_wound)
            warnings_.push_back(fmt::format(
                "frame {}: the material is wound farther than it is stable: it "
                "is left where it would begin to lose turns",
                report.frame));
        s.last_solve = report.solve;
    }
    for (std::string& warning : s.refiner.take_warnings())
        warnings_.push_back(std::move(warning));
    if (report.cells_at_limit >
        kManyAtLimit * static_cast<double>(s.system.poses().size()))
        warnings_.push_back(fmt::format(
            "frame {}: depth limit reached in {} cells: their error is above the "
            "threshold (a larger --max-depth lets them split)",
            report.frame, report.cells_at_limit));
    const SolveReport& total = s.last_solve;
    report.solve = total;
    if (total.stop == Stop::NotPositiveDefinite)
        throw Error(
            Fault::Unsolvable,
            at({handles_.path, 0, ""},
               "frame " + std::to_string(report.frame) +
                   ": the equations have no solution in finite numbers, also damped (a "
                   "move may be too far)"));
    if (total.is_saddle && total.energy_after > 0.0)
        warnings_.push_back(
            fmt::format("frame {}: the result may not be stable: its energy "
                        "falls in some direction",
                        report.frame));
    report.cells = s.system.body().cells.size();
    parts_.refinement += report.refinements;
    report.max_pair_gap = s.system.largest_gap();
    report.pins = pin_reports(s.system);
    report.contacts = contact_report(s.system);
    parts_.contact += report.contacts.has_value();
}

/// Of the last frame.
std::vector<MovedRegion> Session::moved_regions() const
{
    StageState& s = *state_;
    s.system.place_fades();
    std::vector<MovedRegion> moved;
    for (std::size_t r = 0; r < s.system.regions().size(); ++r)
        if (const RegionFade* const fade = s.system.fade(r))
        {
            MovedRegion& region = moved.emplace_back();
            region.fade = fade;
            region.motion = s.system.motions()[r];
            region.may_turn = s.system.regions()[r].is_pin_of_one_place();
            region.bends = s.system.regions()[r].is_rod();
            if (region.bends)
                for (const Eigen::Vector3d& x : fade->nodes())
                    region.node_motions.push_back(s.system.driving().motion_at(r, x));
        }
    for (const TouchingSamples& samples : s.system.touching_samples())
    {
        MovedRegion& region = moved.emplace_back();
        region.fade = &samples.fade;
        region.bends = true;
        region.leading_cells = samples.leading_cells;
        region.rank = samples.rank;
    }
    return moved;
}

std::vector<Eigen::Vector3d> Session::samples_by(const FieldChoice& field) const
{
    check_memory_of(field);
    const CellSystem& system = state_->system;
    std::vector<Eigen::Vector3d> samples = rest_->samples.samples;
    apply_field(fit_field(field, system.body().cells, system.poses(),
                          system.constraints(), moved_regions()),
                system.rest().frame, system.rest().samples, system.body().cell_of_sample,
                {samples});
    return samples;
}

void Session::make_field()
{
    StageState& s = *state_;
    if (!s.fitter)
    {
        // What is kept is for fits to come: a fit that is the first and the last keeps
        // nothing.
        const bool has_other_fits = settings_.keeps_checkpoints ||
                                    frame_ < handles_.stages[stage_].frames.size() ||
                                    rbf_systems_->num_bytes() > 0;
        s.fitter.emplace(settings_.field, s.system.body().cells, s.system.constraints(),
                         has_other_fits ? rbf_systems_.get() : nullptr);
    }
    s.field = std::make_unique<Field>(s.fitter->fit(s.system.poses(), moved_regions()));
}

void Session::move_samples(FrameReport& report)
{
    StageState& s = *state_;
    const WorkFrame& frame = s.system.rest().frame;
    Clock::time_point start = Clock::now();
    make_field();
    const FieldKind kind = settings_.field.kind;
    ++(kind == FieldKind::Rbf ? parts_.rbf
       : is_dense(kind)       ? parts_.rbf_global
                              : parts_.blend);
    report.fit_ms = ms_since(start);

    start = Clock::now();
    const DeformedSamples& rest = rest_->samples;
    auto moved = std::make_shared<DeformedSamples>(
        DeformedSamples{{}, rest.directions, rest.tangents, rest.rotations});
    std::vector<Eigen::Vector3d> displacements = apply_field(
        *s.field, frame, s.system.rest().samples, s.system.body().cell_of_sample,
        {{},
         {use_samples_, moved->directions},
         {geometry_->tangent_samples, moved->tangents},
         {geometry_->rotation_samples, moved->rotations}});
    const double diagonal = frame.diagonal();
    for (std::size_t r = 0; r < s.system.regions().size(); ++r)
    {
        if (!s.system.regions()[r].moves_as_one())
            continue; // of rods what is exact is so by its misses
        const Motion motion = s.system.motions()[r];
        for (const std::uint32_t i : s.system.regions()[r].samples)
        {
            const Eigen::Vector3d& x = s.system.rest().samples[i];
            const Eigen::Vector3d wanted =
                (motion.R - Eigen::Matrix3d::Identity()) * x + motion.t;
            report.handle_residual = std::max(
                report.handle_residual, (displacements[i] - wanted).norm() / diagonal);
        }
    }
    moved->samples = moved_places(frame, rest.samples, std::move(displacements));
    if (s.system.rest().is_flat())
        keep_in_plane(frame.axes.row(s.system.rest().flat_axis), rest.samples,
                      moved->samples);
    deformed_ = std::move(moved);
    parts_.normals +=
        !rest.directions.empty() || !rest.tangents.empty() || !rest.rotations.empty();
    report.apply_ms = ms_since(start);
    is_deformed_current_ = true;
}

void Session::update_samples()
{
    if (frame_ > 0)
        return move_samples(reports_.back());
    deformed_ = samples_at_rest();
    is_deformed_current_ = true;
}

/// The samples as they are now become the rest of the next stage.
void Session::commit()
{
    if (!is_deformed_current_)
        update_samples();
    std::vector<std::shared_ptr<const StoredField>> fields = rest_->fields;
    if (settings_.keeps_fields)
    {
        if (!state_->field)
            make_field(); // a commit that was stopped has left none
        fields.push_back(std::make_shared<const StoredField>(
            stored_field(state_->system, *state_->field)));
    }
    last_rest_ = make_rest(stage_ + 1, *deformed_, std::move(fields));
    start_stage(last_rest_);
}

/// Through commits that no frame follows.
void Session::commit_to_end()
{
    while (stage_ + 1 < handles_.stages.size())
        commit();
}

std::optional<SkeletonBinding> Session::skeleton() const
{
    if (!state_ || !state_->system.regions().skeleton())
        return std::nullopt;
    const CellSystem& system = state_->system;
    SkeletonBinding binding = state_->start->binding;
    for (BoneBinding& bone : binding.bones)
    {
        bone.radius = system.rest().frame.length_to_model(bone.radius);
        for (const int owner : system.region_of_cell())
            bone.cells += owner >= 0 && system.regions()[idx(owner)].name == bone.name;
    }
    return binding;
}

/// Of those that others leave no cell.
void Session::warn_of_bones()
{
    const std::optional<SkeletonBinding> binding = skeleton();
    std::string names;
    for (const BoneBinding& bone : binding ? binding->bones : std::vector<BoneBinding>())
        if (bone.cells == 0)
            names += (names.empty() ? "" : ", ") + bone.name;
    if (!names.empty())
        warnings_.push_back(
            at({handles_.path, 0, "skeleton"},
               "bones without a cell of their own move nothing: " + names +
                   " (smaller cells would part them from others: raise "
                   "--across or --max-depth)"));
}

std::vector<PosedJoint> Session::joints() const
{
    std::vector<PosedJoint> joints;
    if (!state_ || !state_->system.regions().skeleton())
        return joints;
    const SkeletonHandle& skeleton = *state_->system.regions().skeleton();
    const SkeletonAim& aim = state_->aims.skeleton;
    const std::vector<Motion> motions = skeleton.motions(aim, aim, 1.0);
    for (std::size_t j = 0; j < skeleton.size(); ++j)
        joints.push_back({skeleton.statement(j).name, skeleton.parent(j),
                          rest_->shape->frame.to_model(motions[j](skeleton.place(j)))});
    return joints;
}

std::vector<RodReport> Session::rods() const
{
    return state_ ? rod_reports(state_->system, state_->aims.regions)
                  : std::vector<RodReport>();
}

FieldFile Session::field_file() const
{
    FieldFile file;
    for (const auto& field : rest_->fields)
        file.stages.push_back(*field);
    file.stages.push_back(stored_field(state_->system, *state_->field));
    return file;
}

} // namespace cellwarp::core
