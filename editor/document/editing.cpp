// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/editing.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <thread>
#include <utility>
#include <vector>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/geometry_output.h"
#include "library/session/flat.h"
#include "library/session/memory_limit.h"
#include "library/session/pass_through.h"
#include "library/session/scene_settings.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

template <class Future>
bool is_done(const Future& future)
{
    return future.valid() &&
           future.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

bool is_finite(const RigidMove& placement)
{
    return placement.translation.allFinite() && placement.axis.allFinite() &&
           (!placement.pivot || placement.pivot->allFinite()) &&
           placement.axis.norm() > 0 && std::isfinite(placement.degrees);
}

/// Models with more samples have one prepared drag at a time: two of a million
/// samples take 700 MB.
constexpr std::size_t kManySamples = 250'000;

/// Whether a document is opened at rest: what it says of poses is played, by another
/// solver, or is long.
bool opens_at_rest(const Document& document)
{
    const SceneFile scene = document.scene();
    return scene.has_flesh() || scene.time.carries() || document.has_keys_of_scene();
}

/// What a drag has in the hand.
struct ActiveDrag
{
    std::string region;
    std::uint64_t revision = 0; ///< of the document's result, when it was taken
    RigidMove to;
    std::optional<std::size_t> point = {}; ///< of a rod or curve; none: all of it
    PointPlacement point_to = {};
    std::shared_ptr<const RegionSet> regions = {}; ///< of the live drag
    WorkFrame frame = {};                          ///< of the live drag
    int flat_axis = -1; ///< across the plane that the live drag is kept in; -1: none
    std::optional<LiveDrag> live = {}; ///< none while it waits for its cells
    /// It has left the plane that a flat model is kept in by default.
    bool is_in_space = false;
};

} // namespace

struct Editing::State
{
    Document document;
    WorkFrame view;
    std::shared_ptr<const ShapeLayout> layout; ///< of the newest drag
    ShownShape rest, result_shape, shape;
    ShownCells cells, result_cells;
    bool shows_cells = false;
    std::uint64_t version = 0;

    SolveWorker worker;
    std::optional<std::uint64_t> asked; ///< the document's result revision
    bool is_asked_in_space = false;     ///< for the hand alone
    /// The document's result revision for which nobody has asked.
    std::optional<std::uint64_t> unasked;
    std::uint64_t result_revision = 0;
    std::shared_ptr<const DeformedSamples> result;
    ResultFigures figures; ///< of it
    std::string passing;   ///< a warning: it passes through itself
    bool wants_passing = false;
    std::future<std::string> finding_passing;
    std::uint64_t passing_revision = 0; ///< of the result that is looked at
    std::stop_source stop_passing;

    std::optional<DragSource> source; ///< of the newest result
    bool wants_drag = false;          ///< to be made from the source
    std::future<PreparedDrag> preparing;
    std::optional<PreparedDrag> prepared;
    std::vector<Refining> left_over; ///< made for drags that have ended

    std::optional<ActiveDrag> hand;
    std::shared_ptr<const ShownShape> film; ///< the frame that is seen; null: none
    std::shared_ptr<const DeformedSamples> film_deformed; ///< as a file holds it, or null

    std::future<std::vector<Eigen::Vector3d>> drawing; ///< points of a centre line
    std::uint64_t drawing_revision = 0;
    std::optional<DrawnLine> drawn; ///< that nobody has heard of

    std::unique_ptr<FieldExport> field;
    ExportStatus::State seen_field = ExportStatus::State::None;

    explicit State(Document of)
        : document(std::move(of)), view(automatic_frame(document.box())),
          layout(layout_of(document.model()->geometry)),
          rest(shown_at(document.model()->geometry, document.model()->geometry.samples,
                        layout, view)),
          worker(document.model(), view)
    {
        rest.version = ++version;
        rest.lines = shown_joints(document.joints_at_rest(), view);
        result_shape = shape = rest;
        // Edits that an earlier run kept are to be seen.
        if (opens_at_rest(document) && document.is_saved())
            unasked = document.result_revision();
    }
    /// All threads end at the same time, not one after the other.
    ~State()
    {
        worker.cancel();
        stop_passing.request_stop();
        if (field)
            field->cancel();
    }

    bool is_unsolved() const { return unasked == document.result_revision(); }

    void show(const ShownShape& other)
    {
        shape = other;
        shape.version = ++version;
        cells = result_cells;
        cells.version = version;
    }

    void ask()
    {
        if (is_asked())
            return;
        const std::uint64_t revision = document.result_revision();
        is_asked_in_space = is_hand_in_space();
        SceneFile scene = document.scene();
        if (is_asked_in_space)
            scene.settings.cells.flat = false;
        worker.ask(
            {revision, document.handles(), std::move(scene), layout, is_asked_in_space});
        asked = revision;
    }

    bool is_hand_in_space() const { return hand && hand->is_in_space; }

    bool is_asked() const
    {
        return (asked == document.result_revision() &&
                is_asked_in_space == is_hand_in_space()) ||
               is_unsolved() || document.num_recoverable() > 0;
    }

    bool take_solved()
    {
        std::optional<Solved> solved = worker.take();
        if (!solved || solved->revision != document.result_revision())
            return false;
        if (solved->is_for_drag)
        {
            if (is_hand_in_space())
            {
                source = std::move(solved->drag);
                wants_drag = source.has_value();
            }
            return false;
        }
        result = std::move(solved->patch);
        result_revision = solved->revision;
        result_shape = std::move(solved->shape);
        result_cells = std::move(solved->cells);
        figures = std::move(solved->figures);
        passing.clear();
        stop_passing.request_stop();
        wants_passing = figures.report.has_value();
        source = std::move(solved->drag);
        wants_drag = source.has_value();
        if (!hand && !film)
            show(result_shape);
        document.set_rest(solved->stage_fingerprint, std::move(solved->rest));
        document.set_borders(std::move(solved->borders));
        return true;
    }

    /// Looks whether the result passes through itself, when all that the hand needs is
    /// made, and takes what was found. True: there is something to say.
    bool look_at_passing()
    {
        bool is_new = false;
        if (is_done(finding_passing))
        {
            try
            {
                std::string found = finding_passing.get();
                if (passing_revision == document.result_revision())
                {
                    passing = std::move(found);
                    is_new = !passing.empty();
                }
            }
            catch (const std::exception&)
            {
                // It was stopped, or lacks the memory: the result is good without it.
            }
        }
        if (wants_passing && !hand && !finding_passing.valid() && !wants_drag &&
            !preparing.valid() && !worker.is_busy())
        {
            wants_passing = false;
            passing_revision = result_revision;
            stop_passing = std::stop_source();
            finding_passing = std::async(
                std::launch::async,
                [model = document.model(), samples = result,
                 has_contact = document.settings().cells.contact.value_or(false),
                 stop = stop_passing.get_token()]
                {
                    const StopOnRequest scope(stop);
                    return pass_through(model->geometry, samples->samples,
                                        {false, has_contact, false})
                        .warning;
                });
        }
        return is_new;
    }

    /// Makes the next drag where one is wanted, and takes what was made.
    void prepare()
    {
        std::erase_if(left_over, [](const Refining& made) { return is_done(made); });
        if (is_done(preparing))
        {
            try
            {
                prepared = preparing.get();
                layout = prepared->layout;
            }
            catch (const std::exception&)
            {
                // The solve tells what is wrong with these regions; the last drag stays.
            }
        }
        if (wants_drag && prepared && serves_on(*prepared, *source))
        {
            start_from(*prepared, *source);
            wants_drag = false;
        }
        if (wants_drag && !preparing.valid())
        {
            if (layout->order.size() > kManySamples)
                prepared.reset();
            preparing = std::async(std::launch::async, [from = *source]() mutable
                                   { return prepare_drag(std::move(from)); });
            wants_drag = false;
        }
    }

    /// Whether a drag is of the regions as they are now.
    bool fits(const PreparedDrag& drag) const
    {
        const std::vector<EditedRegion>& regions = document.regions();
        const RegionSet& own = *drag.source.regions;
        const std::size_t count = num_without_bones(own);
        const auto told = std::count_if(regions.begin(), regions.end(),
                                        [](const EditedRegion& r) { return !r.joint; });
        if ((is_hand_in_space() && drag.source.body->rest->is_flat()) ||
            drag.source.stage_fingerprint != document.stage_fingerprint() ||
            count != static_cast<std::size_t>(told) ||
            (own.skeleton() ? own.skeleton()->size() : 0) + count != regions.size())
            return false;
        for (std::size_t r = 0; r < count; ++r)
            if (own[r].role != regions[r].role || own[r].factor != regions[r].factor ||
                !(own[r].told ? regions[r].line && *own[r].told == *regions[r].line
                              : own[r].samples == regions[r].samples) ||
                !is_same_guide(own, own[r].guide, regions[r]))
                return false;
        return true;
    }

    /// They stand before the bones.
    static std::size_t num_without_bones(const RegionSet& regions)
    {
        const auto& all = regions.regions();
        return static_cast<std::size_t>(
            std::find_if(all.begin(), all.end(),
                         [](const Region& region) { return region.bone.has_value(); }) -
            all.begin());
    }

    static bool is_same_guide(const RegionSet& own,
                              const std::optional<Region::Guide>& guide,
                              const EditedRegion& region)
    {
        return guide
                   ? own[guide->region].name == region.guide && guide->at == region.share
                   : region.guide.empty();
    }

    std::vector<SplineHolds> holds() const
    {
        std::vector<SplineHolds> holds;
        for (EditedRegion region : document.regions())
        {
            if (holds.size() == hand->regions->size())
                break; // joints without bones
            SplineHolds& of = holds.emplace_back();
            if (!region.spline)
                continue;
            if (hand->point && region.name == hand->region)
                region.points[*hand->point] =
                    moved(region.points[*hand->point], hand->point_to);
            of =
                holds_of(region, *(*hand->regions)[holds.size() - 1].spline, hand->frame);
        }
        return holds;
    }

    std::vector<Motion> motions() const
    {
        const std::vector<Motion> of_joints =
            document.joint_motions(hand->region, hand->to);
        std::vector<Motion> motions;
        for (const Region& own : hand->regions->regions())
        {
            if (own.bone)
            {
                motions.push_back(of_joints[own.bone->joint]);
                continue;
            }
            const EditedRegion& region = document.regions()[motions.size()];
            motions.push_back(
                motion_of(region.name == hand->region ? hand->to : region.placement,
                          region.centre, hand->frame));
        }
        return motions;
    }

    /// An edit from elsewhere has changed what the hand holds: it is opened.
    bool opens_stale_hand()
    {
        if (!hand || hand->revision == document.result_revision())
            return false;
        let_go(false);
        show(result_shape);
        return true;
    }

    bool follow_hand()
    {
        if (!hand)
            return false;
        if (!hand->live)
        {
            if (!prepared || !fits(*prepared))
                return false;
            hand->frame = prepared->source.body->rest->frame;
            hand->flat_axis = prepared->source.body->rest->flat_axis;
            hand->regions = prepared->source.regions;
            PreparedDrag drag = std::move(*prepared);
            prepared.reset();
            wants_drag = source.has_value(); // should it not come to life
            hand->live.emplace(std::move(drag));
            wants_drag = false;
            hand->live->show_cells(shows_cells);
            move_hand();
        }
        if (!hand->live || !hand->live->take(shape, cells))
            return false;
        shape.version = cells.version = ++version;
        return true;
    }

    /// Whether the hand takes a flat model out of the plane that it is kept in by
    /// default.
    bool leaves_plane() const
    {
        if (!hand->live || hand->flat_axis < 0 || document.settings().cells.flat)
            return false;
        const std::vector<Motion> all = motions();
        return std::any_of(all.begin(), all.end(),
                           [&](const Motion& motion)
                           {
                               return !keeps_plane(
                                   motion, Eigen::Vector3d::Unit(hand->flat_axis),
                                   Eigen::Vector3d::Zero(), hand->frame.diagonal());
                           });
    }

    /// Makes the drag wait for cells that are not kept in a plane.
    void follow_into_space()
    {
        hand->is_in_space = true;
        end_live(false);
        hand->live.reset();
        prepared.reset();
        ask();
    }

    /// Moves what the hand holds to where the hand is.
    void move_hand()
    {
        if (!hand->live)
            return;
        if (leaves_plane())
            follow_into_space();
        else
            hand->live->move(motions(), holds());
    }

    /// \p keeps_drag: for the next time, if no newer one is there.
    void end_live(bool keeps_drag)
    {
        std::optional<PreparedDrag> drag = hand->live->stop();
        if (Refining made = hand->live->take_refining(); made.valid())
            left_over.push_back(std::move(made));
        if (keeps_drag && drag && !prepared)
        {
            layout = drag->layout;
            prepared = std::move(drag);
        }
        else
            wants_drag = source.has_value();
    }

    /// Opens the hand; the drag stays for the next time if no newer one is there.
    void let_go(bool keeps_drag)
    {
        if (hand->live)
            end_live(keeps_drag);
        hand.reset();
    }

    /// The rod of a centre line that was found. What has changed meanwhile has no such
    /// rod.
    bool take_drawn()
    {
        if (!is_done(drawing) || hand)
            return false;
        drawn.emplace();
        try
        {
            const std::vector<Eigen::Vector3d> points = drawing.get();
            if (drawing_revision == document.result_revision())
                drawn->name = document.add_line(Role::Rod, {points, false, {}});
            else
                drawn->error = "something has changed meanwhile: no rod was drawn";
        }
        catch (const std::exception& error)
        {
            drawn->error = error.what();
        }
        return true;
    }

    /// Whether a field is at another stage than when it was last looked at.
    bool has_field_news()
    {
        const ExportStatus::State now =
            field ? field->status().state : ExportStatus::State::None;
        return std::exchange(seen_field, now) != now;
    }

    bool is_solved() const { return is_asked() && !worker.is_busy(); }

    bool is_settled() const
    {
        const bool is_writing =
            field && field->status().state == ExportStatus::State::Working;
        return is_solved() && !is_writing && !drawing.valid() && !wants_drag &&
               !preparing.valid();
    }
    bool is_at_rest() const
    {
        return is_settled() && (hand || !wants_passing) && !finding_passing.valid();
    }

    /// Updates until it is so before an update and after it: what the threads had
    /// finished before has been taken by it.
    void wait_until(Editing& editing, bool (State::*is_so)() const) const
    {
        for (bool was_so = false;; was_so = (this->*is_so)())
        {
            editing.update();
            if (was_so && (this->*is_so)())
                return;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    }
};

Editing::Editing(Document document) : state_(std::make_unique<State>(std::move(document)))
{
    state_->ask();
}

Editing::~Editing() = default;

Document& Editing::document()
{
    return state_->document;
}

const Document& Editing::document() const
{
    return state_->document;
}

bool Editing::update()
{
    State& s = *state_;
    const bool is_opened = s.opens_stale_hand();
    const bool is_drawn = s.take_drawn();
    s.ask();
    const bool is_solved = s.take_solved();
    s.prepare();
    const bool has_moved = s.follow_hand();
    const bool is_warned = s.look_at_passing();
    const bool is_exported = s.has_field_news();
    return is_opened || is_drawn || is_solved || has_moved || is_warned || is_exported;
}

void Editing::wait_for_result()
{
    state_->wait_until(*this, &State::is_solved);
}

void Editing::wait_for_drag()
{
    state_->wait_until(*this, &State::is_settled);
}

void Editing::wait()
{
    state_->wait_until(*this, &State::is_at_rest);
}

void Editing::cancel()
{
    state_->worker.cancel();
}

void Editing::solve()
{
    state_->asked.reset();
    state_->unasked.reset();
}

bool Editing::is_unsolved() const
{
    return state_->is_unsolved();
}

const WorkFrame& Editing::view_frame() const
{
    return state_->view;
}

const ShownShape& Editing::shape() const
{
    return state_->shape;
}

const ShownShape& Editing::rest_shape() const
{
    return state_->rest;
}

const ShownCells& Editing::cells() const
{
    return state_->cells;
}

void Editing::show_cells(bool shows)
{
    state_->shows_cells = shows;
    if (state_->hand && state_->hand->live)
        state_->hand->live->show_cells(shows);
}

std::shared_ptr<const DeformedSamples> Editing::result() const
{
    return state_->result_revision == state_->document.result_revision() ? state_->result
                                                                         : nullptr;
}

SolveStatus Editing::status() const
{
    SolveStatus status = state_->worker.status();
    // Figures are those of the shape that is seen.
    static_cast<ResultFigures&>(status) = state_->figures;
    if (!state_->passing.empty())
        status.warnings.push_back(state_->passing);
    return status;
}

DragStatus Editing::drag_status() const
{
    if (!state_->hand)
        return {};
    if (state_->hand->live)
        return state_->hand->live->status();
    DragStatus waiting;
    waiting.is_dragging = true;
    return waiting;
}

bool Editing::begin_drag(const std::string& region, std::string* why)
{
    State& s = *state_;
    const auto refuse = [&](const std::string& reason)
    {
        if (why)
            *why = reason;
        return false;
    };
    if (s.hand)
        return refuse("another region is in the hand");
    if (s.film)
        return refuse("a film is shown: it has to end first");
    s.unasked.reset();
    update(); // regions are found anew where a rest shape has come
    const EditedRegion* const found = s.document.region(region);
    if (!found)
        return refuse("there is no region " + in_quotes(region));
    if (!found->moves())
        return refuse(in_quotes(region) + " is " + role_name(found->role) +
                      ": only handles and pins move");
    if (!found->knows_samples || !found->knows_placement)
        return refuse(
            in_quotes(region) +
            " lies on a shape that is not there yet, or turns about its border, which "
            "the cells tell when they are there");
    const bool is_ready = s.prepared && s.fits(*s.prepared);
    if (const SolveStatus status = s.worker.status();
        !is_ready && s.is_settled() && status.state == SolveStatus::State::Failed)
        return refuse(status.error);
    if (s.finding_passing.valid()) // the hand needs the cores
    {
        s.stop_passing.request_stop();
        s.wants_passing = true;
    }
    ActiveDrag& hand = s.hand.emplace();
    hand.region = region;
    hand.revision = s.document.result_revision();
    hand.to = found->placement;
    s.follow_hand();
    return true;
}

bool Editing::begin_point_drag(const std::string& region, std::size_t point,
                               std::string* why)
{
    State& s = *state_;
    const EditedRegion* const found = s.document.region(region);
    if (found && point >= found->points.size())
    {
        if (why)
            *why = in_quotes(region) + " has no point " + std::to_string(point);
        return false;
    }
    if (!begin_drag(region, why))
        return false;
    s.hand->point = point;
    return true;
}

void Editing::drag_point_to(const PointPlacement& to)
{
    State& s = *state_;
    if (s.opens_stale_hand() || !s.hand || !s.hand->point || to == s.hand->point_to ||
        (to.place && !to.place->allFinite()) ||
        (to.degrees && !std::isfinite(*to.degrees)))
        return;
    s.hand->point_to = to;
    if (s.hand->live)
        s.hand->live->move(s.motions(), s.holds());
}

void Editing::show_instead(std::shared_ptr<const ShownShape> frame,
                           std::shared_ptr<const DeformedSamples> deformed)
{
    State& s = *state_;
    s.film_deformed = std::move(deformed);
    if (frame == s.film)
        return;
    if (s.hand)
        cancel_drag();
    s.film = std::move(frame);
    s.show(s.film ? *s.film : s.result_shape);
    if (s.film)
        s.cells.cells.clear(); // they are those of the result
}

bool Editing::shows_film() const
{
    return state_->film != nullptr;
}

void Editing::draw_centre_line(const std::vector<std::uint32_t>& near)
{
    State& s = *state_;
    if (is_drawing())
        throw Error(Fault::Usage, "a centre line is looked for already");
    s.unasked.reset();
    s.drawn.reset();
    s.drawing_revision = s.document.result_revision();
    s.drawing = std::async(std::launch::async, s.document.centre_line(near, result()));
}

bool Editing::is_drawing() const
{
    return state_->drawing.valid();
}

std::optional<DrawnLine> Editing::take_drawn()
{
    return std::exchange(state_->drawn, std::nullopt);
}

void Editing::drag_to(const RigidMove& placement)
{
    State& s = *state_;
    if (s.opens_stale_hand() || !s.hand || !is_finite(placement) ||
        placement == s.hand->to)
        return;
    s.hand->to = placement;
    s.move_hand();
}

void Editing::end_drag()
{
    State& s = *state_;
    if (s.opens_stale_hand() || !s.hand)
        return;
    const std::string region = s.hand->region;
    const RigidMove to = s.hand->to;
    const std::optional<std::size_t> point = s.hand->point;
    const PointPlacement point_to = s.hand->point_to;
    const EditedRegion* const held = s.document.region(region);
    if (point ? point_to == PointPlacement() : held && is_at(*held, to))
    {
        cancel_drag();
        return;
    }
    s.let_go(true);
    if (point)
        s.document.move_point(region, *point, point_to);
    else
        s.document.move_region(region, to);
    s.ask();
}

void Editing::cancel_drag()
{
    State& s = *state_;
    if (!s.hand)
        return;
    s.let_go(false);
    s.show(s.result_shape);
}

std::optional<std::string> Editing::dragged() const
{
    return state_->hand ? std::optional(state_->hand->region) : std::nullopt;
}

std::optional<RigidMove> Editing::dragged_placement() const
{
    const auto& hand = state_->hand;
    return hand && !hand->point ? std::optional(hand->to) : std::nullopt;
}

std::string Editing::why_no_export() const
{
    const State& s = *state_;
    if (s.film)
        return s.film_deformed ? ""
                               : "live flesh moves on while it is written: stop it, or "
                                 "play the scene and hold a frame";
    if (s.hand)
        return in_quotes(s.hand->region) + " is in the hand: let it go first";
    return result() ? ""
           : is_unsolved()
               ? "the scene is seen at rest: solve it, or play it and hold a frame"
               : "the result is not there yet";
}

std::string Editing::why_no_field_export() const
{
    return state_->film ? "the field is of what is edited, and a film is seen: stop it "
                          "first"
           : state_->hand
               ? in_quotes(state_->hand->region) + " is in the hand: let it go first"
               : "";
}

void Editing::export_model(const std::string& path, Overwrite overwrite)
{
    if (const std::string why = why_no_export(); !why.empty())
        throw Error(Fault::Usage, why);
    const std::shared_ptr<const DeformedSamples> patch =
        state_->film ? state_->film_deformed : result();
    const GeometryFile& model = *state_->document.model();
    check_output_format(path, model.geometry.format);
    check_geometry_output(path, model, overwrite);
    write_geometry(path, model, *patch, overwrite);
}

void Editing::export_field(const std::string& path, Overwrite overwrite)
{
    if (const std::string why = why_no_field_export(); !why.empty())
        throw Error(Fault::Usage, why);
    const Document& document = state_->document;
    if (extension_of(path) != "cwf")
        throw Error(Fault::Usage,
                    "a field's name ends in .cwf (got " + in_quotes(path) + ")");
    HandleFile handles = document.handles();
    if (handles.stages.back().frames.empty() && handles.stages.size() > 1)
        handles.stages.pop_back(); // regions that nothing has moved yet
    if (handles.stages.back().frames.empty())
        throw Error(Fault::Usage, "nothing has moved: there is no field");
    State& s = *state_;
    if (s.field && s.field->status().state == ExportStatus::State::Working)
        throw Error(Fault::Usage, "another field is being written");
    SessionSettings settings = settings_of(document.scene());
    settings.cells.max_memory = default_memory_limit();
    s.field = std::make_unique<FieldExport>(document.model(), std::move(handles),
                                            std::move(settings), path, overwrite);
    s.seen_field = ExportStatus::State::Working;
}

void Editing::cancel_export()
{
    if (state_->field)
        state_->field->cancel();
}

ExportStatus Editing::export_status() const
{
    return state_->field ? state_->field->status() : ExportStatus();
}

} // namespace cellwarp::core
