// SPDX-License-Identifier: GPL-3.0-or-later
// What the user does to a document, each command one edit.
#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "editor/document/document_state.h"
#include "library/session/scene_settings.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Why a region that is told by places cannot be changed yet.
constexpr const char* kNoRest =
    " lies on a shape that is not there yet (wait for the result of what comes before "
    "it), or turns about its border, which the cells tell when they are there";

/// Whether samples can be of one such region alone.
bool prescribes(Role role)
{
    return role == Role::Fixed || role == Role::Handle || role == Role::Pin;
}

std::vector<std::uint32_t> without(const std::vector<std::uint32_t>& samples,
                                   const std::vector<std::uint32_t>& others)
{
    std::vector<std::uint32_t> left;
    std::set_difference(samples.begin(), samples.end(), others.begin(), others.end(),
                        std::back_inserter(left));
    return left;
}

RegionStatement statement_of(const std::string& name, Role role, double factor,
                             const std::vector<std::uint32_t>& samples)
{
    RegionStatement statement;
    statement.name = name;
    statement.role = role;
    statement.factor = role == Role::Stiff ? factor : 1.0;
    statement.selector = selector_of(samples);
    return statement;
}

constexpr const char* kSpline = " is a rod or a curve: points tell it, no samples do";
constexpr const char* kJoint = " is a joint of the skeleton: it can only be moved";

void refuse_joint(const EditedRegion& region)
{
    if (region.joint)
        throw usage(in_quotes(region.name) + kJoint);
}

bool is_same(const RegionStatement& a, const RegionStatement& b)
{
    return a.role == b.role && a.name == b.name && a.factor == b.factor &&
           a.selector.kind == b.selector.kind &&
           a.selector.numbers == b.selector.numbers &&
           a.selector.ranges == b.selector.ranges && a.selector.name == b.selector.name &&
           a.selector.label == b.selector.label && !a.spline == !b.spline &&
           (!a.spline || *a.spline == *b.spline);
}

/// The part of two lists in which they differ.
RegionChange change_between(const std::vector<RegionStatement>& before,
                            const std::vector<RegionStatement>& after)
{
    const auto first =
        std::mismatch(before.begin(), before.end(), after.begin(), after.end(), is_same);
    const auto last =
        std::mismatch(before.rbegin(), std::make_reverse_iterator(first.first),
                      after.rbegin(), std::make_reverse_iterator(first.second), is_same);
    return {idx(first.first - before.begin()),
            {first.first, last.first.base()},
            {first.second, last.second.base()}};
}

} // namespace

const std::vector<std::uint32_t>& Document::State::samples_of(const EditedRegion& region)
{
    if (!region.knows_samples)
        throw usage(in_quotes(region.name) + kNoRest);
    return region.samples;
}

std::vector<RegionDraft> Document::State::drafts()
{
    std::vector<RegionDraft> drafts;
    for (const EditedRegion& region : regions)
    {
        // After a commit rods and curves start anew, from statements of their own.
        if (region.joint || (region.is_spline() && !frames().empty()))
            continue;
        RegionDraft& draft = drafts.emplace_back(RegionDraft{{}, &region});
        if (!frames().empty() && !samples_of(region).empty())
            draft.statements = {
                statement_of(region.name, region.role, region.factor, region.samples)};
        else
            std::copy_if(statements().begin(), statements().end(),
                         std::back_inserter(draft.statements),
                         [&](const RegionStatement& statement)
                         { return statement.name == region.name; });
    }
    return drafts;
}

void Document::State::take_from_others(std::vector<RegionDraft>& drafts,
                                       const std::vector<std::uint32_t>& samples,
                                       Role role, const std::string& but)
{
    if (!prescribes(role))
        return;
    for (RegionDraft& draft : drafts)
    {
        const EditedRegion& region = *draft.region;
        if (region.name == but || !prescribes(region.role))
            continue;
        const std::vector<std::uint32_t>& own = samples_of(region);
        const std::vector<std::uint32_t> left = without(own, samples);
        if (left.size() == own.size())
            continue;
        draft.statements.clear();
        if (!left.empty())
            draft.statements = {
                statement_of(region.name, region.role, region.factor, left)};
    }
}

void Document::State::push_regions(const std::string& name,
                                   const std::vector<RegionDraft>& drafts,
                                   const std::vector<RegionStatement>& more,
                                   std::vector<Change> changes)
{
    std::vector<RegionStatement> after;
    for (const RegionDraft& draft : drafts)
        after.insert(after.end(), draft.statements.begin(), draft.statements.end());
    after.insert(after.end(), more.begin(), more.end());
    if (!frames().empty())
    {
        changes.push_back(StageAdded{after});
        push({name, changes});
        return;
    }
    const RegionChange change = change_between(statements(), after);
    if (change.before.empty() && change.after.empty())
        return;
    changes.push_back(change);
    push({name, changes});
}

std::vector<std::uint32_t> Document::State::selected() const
{
    if (edited.selection.empty())
        throw usage("nothing is selected");
    return ground().coincident.of(edited.selection.samples());
}

void Document::State::check_new_name(const std::string& name) const
{
    if (name.empty() || !is_handle_name(name))
        throw usage("a region cannot be called " + in_quotes(name));
    if (std::any_of(regions.begin(), regions.end(),
                    [&](const EditedRegion& region) { return region.name == name; }))
        throw usage("there is a region " + in_quotes(name) + " already");
}

std::string Document::State::free_name(Role role) const
{
    const std::string word = role_name(role);
    for (int number = 1;; ++number)
    {
        const std::string name = number == 1 ? word : word + std::to_string(number);
        if (std::none_of(regions.begin(), regions.end(),
                         [&](const EditedRegion& region) { return region.name == name; }))
            return name;
    }
}

std::int64_t Document::State::next_number() const
{
    std::int64_t number = 1;
    for (const Stage& one : edited.handles.stages)
        if (!one.frames.empty())
            number = one.frames.back().number + 1;
    if (number >= kLastFrame)
        throw usage("a handle file has no frame after " + std::to_string(kLastFrame));
    return number;
}

std::optional<DefaultPlane> Document::State::default_plane() const
{
    const CellSettings cells = settings_of(with_settings(scene, edited.settings)).cells;
    return cells.is_flat ? std::nullopt : DefaultPlane::of(ground().rest, cells);
}

std::vector<Change> Document::State::with_frames(std::vector<FrameStatement> added) const
{
    std::vector<Change> changes;
    const std::optional<DefaultPlane> plane = default_plane();
    if (plane &&
        plane->is_left(edited.handles.stages.back(), added, edited.handles.is_relative))
    {
        SceneSettings in_space = edited.settings;
        in_space.cells.flat = false;
        changes.push_back(SettingsChange{edited.settings, in_space});
    }
    changes.push_back(FramesAdded{std::move(added)});
    return changes;
}

const EditedRegion& Document::State::line_to_change(const std::string& region) const
{
    const EditedRegion& found = find(region);
    if (!found.is_spline())
        throw usage(in_quotes(region) + " is no rod or curve");
    if (!edited.handles.stages.back().frames.empty())
        throw usage(
            "something has moved: rods and curves can be changed before that (undo "
            "goes back there)");
    return found;
}

void Document::State::change_line(const EditedRegion& region, const SplineStatement& line)
{
    std::vector<RegionDraft> drafts = this->drafts();
    for (RegionDraft& draft : drafts)
        if (draft.region == &region)
            draft.statements.front().spline =
                std::make_shared<const SplineStatement>(line);
    push_regions("Change " + region.name, drafts);
}

void Document::select(const Selection& selection, const std::string& name)
{
    const Selection toggled = state_->edited.selection.difference(selection);
    if (!toggled.empty())
        state_->push({name, {Toggled{toggled.runs()}}});
}

std::string Document::add_region(Role role, const std::string& name)
{
    State& s = *state_;
    const std::vector<std::uint32_t> samples = s.selected();
    if (role == Role::Rod || role == Role::Curve)
        throw usage("a rod or curve is told by points, not by samples");
    const std::string given = name.empty() ? s.free_name(role) : name;
    s.check_new_name(given);
    std::vector<RegionDraft> drafts = s.drafts();
    State::take_from_others(drafts, samples, role, given);
    // The selection has done its work: the colour of the region is to be seen.
    const std::string word = role_name(role);
    s.push_regions("Make " + (given == word ? word : word + " " + given), drafts,
                   {statement_of(given, role, kUsualStiffness, samples)},
                   {Toggled{s.edited.selection.runs()}});
    return given;
}

void Document::set_samples(const std::string& region)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    refuse_joint(old);
    if (old.is_spline())
        throw usage(in_quotes(region) + kSpline);
    const std::vector<std::uint32_t> samples = s.selected();
    std::vector<RegionDraft> drafts = s.drafts();
    for (RegionDraft& draft : drafts)
        if (draft.region == &old)
            draft.statements = {statement_of(old.name, old.role, old.factor, samples)};
    State::take_from_others(drafts, samples, old.role, old.name);
    s.push_regions("Change " + region, drafts);
}

void Document::remove_region(const std::string& region)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    refuse_joint(old);
    std::vector<Change> changes;
    std::vector<OnStatement> ons = s.stage().ons;
    std::erase_if(ons, [&](const OnStatement& on)
                  { return on.pin == region || on.guide == region; });
    if (s.frames().empty() && ons.size() != s.stage().ons.size())
        changes.push_back(OnsChange{s.stage().ons, ons});
    std::vector<RegionDraft> drafts = s.drafts();
    std::erase_if(drafts, [&](const RegionDraft& draft) { return draft.region == &old; });
    s.push_regions("Remove " + region, drafts, {}, changes);
}

void Document::rename_region(const std::string& region, const std::string& name)
{
    State& s = *state_;
    refuse_joint(s.find(region));
    if (name == region)
        return;
    s.check_new_name(name);
    s.push({"Rename " + region, {Renamed{region, name}}});
}

void Document::set_role(const std::string& region, Role role, double factor)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    refuse_joint(old);
    if (!(factor > 0) || !std::isfinite(factor))
        throw usage("stiffness: need a factor above 0 (got " + shortest(factor) + ")");
    if (old.is_spline() || role == Role::Rod || role == Role::Curve)
        throw usage(in_quotes(region) + kSpline);
    if (old.role == role && (role != Role::Stiff || old.factor == factor))
        return;
    std::vector<RegionDraft> drafts = s.drafts();
    for (RegionDraft& draft : drafts)
        if (draft.region == &old)
            for (RegionStatement& statement : draft.statements)
            {
                statement.role = role;
                statement.factor = role == Role::Stiff ? factor : 1.0;
            }
    if (prescribes(role))
        State::take_from_others(drafts, State::samples_of(old), role, old.name);
    s.push_regions("Make " + region + " " + role_name(role), drafts);
}

void Document::move_region(const std::string& region, const RigidMove& placement)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    if (!old.moves())
        throw usage(in_quotes(region) + " is " + role_name(old.role) +
                    (old.is_guided() ? " that stays on a curve: this moves it"
                                     : ": only handles, pins and rods move"));
    if (!placement.translation.allFinite() || !placement.axis.allFinite() ||
        !std::isfinite(placement.degrees) || !(placement.axis.norm() > 0))
        throw usage("a place needs finite numbers");
    if (!old.knows_placement)
        throw usage(in_quotes(region) + kNoRest);
    RigidMove to = placement;
    if (old.role == Role::Pin)
        to.degrees = 0.0; // it turns as it likes
    if (to.degrees == 0.0)
    {
        to.axis = old.placement.axis;
        to.pivot = old.placement.pivot;
    }
    if (to.pivot && !to.pivot->allFinite())
        throw usage("a pivot needs finite numbers");
    if (const RegionGround on = s.ground(); to.pivot && !can_tell(*to.pivot, on.units))
    {
        EditedRegion moved = old;
        moved.placement = to;
        to = about(old.centre, moved);
    }
    // The middle of a region's box depends on whether the model is kept in its plane.
    if (const auto plane = s.default_plane();
        plane && plane->is_askew() && to.degrees != 0.0 && !to.pivot)
        to.pivot = old.centre;
    if (is_at(old, to))
        return;
    const bool turns = to.degrees != old.placement.degrees;
    s.push({(turns ? "Turn " : "Move ") + region,
            s.with_frames(frames_to(old, to, s.next_number(), s.ground()))});
}

void Document::release_joint(const std::string& joint)
{
    State& s = *state_;
    const EditedRegion& old = s.find(joint);
    if (!old.joint || !old.joint->is_held)
        throw usage(in_quotes(joint) + " is no joint that is held at a place");
    Move move;
    move.region = joint;
    move.released = HoldParts{true, true, true};
    s.push({"Release " + joint, {FramesAdded{{{s.next_number(), {move}, 0}}}}});
}

std::string Document::add_line(Role role, const RodShape& shape, const std::string& name)
{
    State& s = *state_;
    if (role != Role::Rod && role != Role::Curve)
        throw usage("only rods and curves are told by points");
    if (shape.points.size() < (shape.is_closed ? 3 : 2))
        throw usage("a line needs two points, a closed one three");
    if (!s.knows_rest())
        throw usage("the line" + std::string(kNoRest));
    if (!s.frames().empty() && s.edited.handles.is_relative)
        throw usage("in relative units lines are drawn before anything has moved");
    const std::string given = name.empty() ? s.free_name(role) : name;
    s.check_new_name(given);
    RegionStatement statement;
    statement.name = given;
    statement.role = role;
    statement.spline =
        std::make_shared<const SplineStatement>(line_of(shape, role, s.ground()));
    s.push_regions("Draw " + given, s.drafts(), {statement});
    return given;
}

void Document::set_line(const std::string& region, const RodShape& shape)
{
    State& s = *state_;
    const EditedRegion& old = s.line_to_change(region);
    const bool is_closed = shape.is_closed;
    const std::size_t least = old.line->form == SplineStatement::Form::Points ? 4
                              : is_closed                                     ? 3
                                                                              : 2;
    if (shape.points.size() < least)
        throw usage(in_quotes(region) + " needs " + std::to_string(least) + " points");
    s.change_line(old, line_of(shape, old.role, s.ground(), *old.line));
}

void Document::move_point(const std::string& region, std::size_t point,
                          const PointPlacement& placement)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    PointPlacement to = placement;
    if (old.role == Role::Curve)
        to.degrees.reset(); // it has no material that could turn
    if (point >= old.points.size())
        throw usage(in_quotes(region) + " has no point " + std::to_string(point));
    if ((to.place && !to.place->allFinite()) ||
        (to.degrees && !std::isfinite(*to.degrees)))
        throw usage("a place needs finite numbers");
    if (!old.knows_placement)
        throw usage(in_quotes(region) + kNoRest);
    if (moved(old.points[point], to) == old.points[point])
        return;
    s.push(
        {fmt::format("{} {} of {}", to.place ? "Move point" : "Turn point", point,
                     region),
         {FramesAdded{{frame_of_point(old, point, to, s.next_number(), s.ground())}}}});
}

void Document::release_point(const std::string& region, std::size_t point,
                             const HoldParts& parts)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    if (point >= old.points.size())
        throw usage(in_quotes(region) + " has no point " + std::to_string(point));
    if (old.role != Role::Rod)
        throw usage(in_quotes(region) + " is a curve: it goes where its points are put");
    const HoldParts& now = old.points[point].parts;
    if (!(now.place && parts.place) && !(now.tangent && parts.tangent) &&
        !(now.twist && parts.twist))
        return;
    s.push({fmt::format("Release point {} of {}", point, region),
            {FramesAdded{{frame_of_release(old, point, parts, s.next_number())}}}});
}

void Document::put_on(const std::string& pin, const std::string& guide,
                      std::optional<double> share)
{
    State& s = *state_;
    const EditedRegion& old = s.find(pin);
    if (old.role != Role::Pin)
        throw usage(in_quotes(pin) + " is no pin: only pins stay on curves");
    if (share && !(0.0 <= *share && *share <= 1.0))
        throw usage("a share of a curve is between 0 and 1");
    if (!s.frames().empty())
        throw usage(
            "something has moved: pins can be put on curves before that (undo goes "
            "back there)");
    std::vector<OnStatement> ons = s.stage().ons;
    std::erase_if(ons, [&](const OnStatement& on) { return on.pin == pin; });
    if (!guide.empty())
    {
        if (!s.find(guide).is_spline())
            throw usage(in_quotes(guide) + " is no rod or curve");
        ons.push_back({pin, guide, share, 0});
    }
    if (old.guide == guide && old.share == share)
        return;
    s.push({guide.empty() ? "Free " + pin : "Put " + pin + " on " + guide,
            {OnsChange{s.stage().ons, ons}}});
}

void Document::change_settings(const SceneSettings& settings)
{
    State& s = *state_;
    if (settings == s.edited.settings)
        return;
    const SceneFile scene = with_settings(s.scene, settings);
    parse_scene(scene.path, scene_text(scene)); // throws for what a file may not say
    s.push({"Change settings", {SettingsChange{s.edited.settings, settings}}});
}

} // namespace cellwarp::core
