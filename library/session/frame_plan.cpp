// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/frame_plan.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "io/base/error.h"
#include "library/session/flat.h"
#include "library/session/spline_holds.h"
#include "octree/base/half_turn.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Two motions of one sample that differ by no more are one [diagonal].
constexpr double kSameMotion = 1e-12;

/// A handle that travels farther than this gets a warning [diagonal].
constexpr double kExtremeMove = 100.0;

/// Where parts do not pass through each other a step is no longer [coarsest cell].
constexpr double kEdgesOfContact = 1.0;

/// Regions that hold one sample must move it alike.
void check_overlaps(const std::vector<Motion>& motions, const RegionSet& regions,
                    const RestShape& rest, const std::string& file, std::int64_t line)
{
    for (const RegionSet::Overlap& overlap : regions.overlaps())
    {
        for (const std::size_t pin : {overlap.a, overlap.b})
            if (regions[pin].guide)
                throw malformed(
                    {file, regions[pin].guide->line, regions[pin].name},
                    fmt::format("stays on a curve, but {} holds its sample {}",
                                regions[overlap.a + overlap.b - pin].name,
                                overlap.sample));
        for (const std::size_t pin : {overlap.a, overlap.b})
            if (regions[pin].turns_freely())
                throw malformed(
                    {file, regions[pin].line, regions[pin].name},
                    fmt::format("turns as it likes, but {}{} holds its sample {}",
                                regions[overlap.a + overlap.b - pin].name,
                                line_note(regions[overlap.a + overlap.b - pin]),
                                overlap.sample));
        const Eigen::Vector3d& x = rest.samples[overlap.sample];
        const double apart = (motions[overlap.a](x) - motions[overlap.b](x)).norm();
        const double scale =
            std::max(rest.frame.diagonal(), motions[overlap.a](x).norm());
        if (!(apart <= kSameMotion * scale))
            throw malformed({file, line, regions[overlap.a].name},
                            fmt::format("it and {}{} both hold sample {} and move it "
                                        "differently ({:.3g} of the diagonal apart)",
                                        regions[overlap.b].name,
                                        line_note(regions[overlap.b]), overlap.sample,
                                        apart / rest.frame.diagonal()));
    }
}

/// A rotation whose axis passes the border farther off than this gets a warning
/// [diagonal], and one by less than this none [degree].
constexpr double kFarFromBorder = 0.1, kSmallTurn = 15.0;

/// How far from a region's border an axis passes that a move turns it about for want of
/// another centre than its box's: so far aside the border is swung; 0: there is none.
/// \p steps: of the move.
double off_border(const Move& move, std::span<const MoveStep> steps,
                  const Eigen::Vector3d& border)
{
    double off = 0.0;
    for (std::size_t k = 0; k < steps.size(); ++k)
        if (const Operation& o = move.operations[k];
            o.kind == Operation::Kind::Rotate && !o.move.pivot && !o.is_about_border &&
            std::abs(o.move.degrees) >= kSmallTurn)
        {
            const RigidMove& turn = std::get<RigidMove>(steps[k]);
            off = std::max(off, turn.axis.cross(border - *turn.pivot).norm());
        }
    return off;
}

/// The point of a rod or curve that a move is about.
std::size_t point_of(const Move& move, const SplineHandle& spline,
                     const std::string& file)
{
    switch (move.place.kind)
    {
    case MovePlace::Kind::End:
        return spline.num_points() - 1;
    case MovePlace::Kind::Point:
        if (move.place.point >= static_cast<std::int64_t>(spline.num_points()))
            throw malformed({file, move.line, "point"},
                            fmt::format("got {}, need 0 to {}", move.place.point,
                                        spline.num_points() - 1));
        return static_cast<std::size_t>(move.place.point);
    default:
        return 0;
    }
}

/// From the rest place of a pin to where it is to be on its curve.
double way_to_guide(const RegionSet& regions, std::size_t pin, const RestShape& rest)
{
    const Region& region = regions[pin];
    const SplineHandle& spline = *regions[region.guide->region].spline;
    const Eigen::Vector3d& x = rest.samples[region.samples.front()];
    const double s = region.guide->at ? spline.parameter_of_share(*region.guide->at)
                                      : spline.nearest(x);
    return (spline.rest()->at(s).place - x).norm();
}

/// In how many parts the points of a rod or curve go their way; \p size: what they go a
/// quarter of at the most.
int num_parts_of(const SplineHandle& spline, const SplineHolds& from,
                 const SplineHolds& to, double size)
{
    if (from == to)
        return 1;
    double way = 0.0;
    for (std::size_t k = 0; k < to.size() && size > 0; ++k)
        way = std::max(way, (to[k].place - from[k].place).norm() / size);
    return parts_of_way(turn_between(spline, from, to), way);
}

/// Of the move of a region; of the frame where it has none.
std::int64_t line_of(const FrameStatement& frame, const std::string& region)
{
    for (const Move& move : frame.moves)
        if (move.region == region)
            return move.line;
    return frame.line;
}

/// Regions that turn by half a turn, together where they turn alike.
std::vector<std::vector<std::size_t>>
half_turns_of(std::span<const HandleTrajectory> paths)
{
    std::vector<std::vector<std::size_t>> groups;
    std::vector<Eigen::Matrix3d> turns;
    for (std::size_t r = 0; r < paths.size(); ++r)
        if (const std::optional<Eigen::Matrix3d> turn = paths[r].half_turn())
        {
            const auto like =
                std::find_if(turns.begin(), turns.end(),
                             [&](const Eigen::Matrix3d& other) {
                                 return (other - *turn).norm() <= 4.0 * kHalfTurnRounding;
                             });
            if (like == turns.end())
            {
                turns.push_back(*turn);
                groups.push_back({r});
            }
            else
                groups[static_cast<std::size_t>(like - turns.begin())].push_back(r);
        }
    return groups;
}

} // namespace

StageAims rest_aims(const RegionSet& regions)
{
    StageAims aims;
    aims.regions.resize(regions.size());
    if (regions.skeleton())
        aims.skeleton = regions.skeleton()->rest();
    return aims;
}

void warn_of_joints(const SkeletonHandle& skeleton, const SkeletonAim& aim,
                    const FrameStatement& frame, const std::string& file, double diagonal,
                    std::vector<std::string>& warnings)
{
    if (aim.limited > 0)
        warnings.push_back(at({file, frame.line, ""},
                              fmt::format("frame {}: {} turns of joints are cut to their "
                                          "limits",
                                          frame.number, aim.limited)));
    for (const JointHold& hold : aim.holds)
        if (hold.miss > kReachedPlace * diagonal)
            warnings.push_back(
                at({file, frame.line, skeleton.statement(idx(hold.joint)).name},
                   fmt::format("frame {}: ends {:.3g} of the diagonal from its place, "
                               "which is out of reach",
                               frame.number, hold.miss / diagonal)));
}

bool is_of_points(const Move& move)
{
    return move.place.kind != MovePlace::Kind::Whole || move.released.has_value();
}

void hold_point(const Move& move, const SplineHandle& spline, const Units& units,
                const std::string& file, std::int64_t frame, SplineHolds& holds)
{
    const std::size_t point = point_of(move, spline, file);
    SplineHold& now = holds[point];
    if (move.released)
    {
        const auto release = [&](HoldParts& parts)
        {
            parts.place &= !move.released->place;
            parts.tangent &= !move.released->tangent;
            parts.twist &= !move.released->twist;
        };
        release(now.parts);
        if (move.place.kind == MovePlace::Kind::Whole && !spline.is_closed())
            release(holds.back().parts);
        return;
    }
    const SplineHold rest = spline.rest_holds()[point];
    std::optional<Eigen::Vector3d> place;
    for (const Operation& operation : move.operations)
        switch (operation.kind)
        {
        case Operation::Kind::Translate:
            place = place.value_or(rest.place) + units.vector(operation.move.translation);
            break;
        case Operation::Kind::To:
            place = units.point(operation.vector);
            break;
        case Operation::Kind::Turn:
        {
            const double turn = operation.move.degrees * std::numbers::pi / 180.0;
            if (!(std::abs(turn - now.turn) <= kMostParts * kTurnOfPart))
                throw malformed(
                    {file, move.line, move.region},
                    fmt::format("frame {}: a turn goes {}° in one frame at "
                                "the most: more need several frames",
                                frame,
                                kMostParts * kTurnOfPart * 180.0 / std::numbers::pi));
            now.parts.twist = true;
            now.turn = turn;
            break;
        }
        case Operation::Kind::Tangent:
            now.parts.tangent = true;
            now.is_told = true;
            now.tangent = (units.frame.axes *
                           (operation.vector / operation.vector.cwiseAbs().maxCoeff()))
                              .normalized();
            break;
        default:
            break;
        }
    if (place)
    {
        now.parts.place = true;
        now.place = *place;
    }
    if (!now.place.allFinite() || !std::isfinite(now.turn))
        throw malformed({file, move.line, move.region},
                        "moves beyond what numbers can hold");
    if ((now.parts.tangent || now.parts.twist) && !spline.has_frame_at(point))
        throw malformed({file, move.line, move.region},
                        fmt::format("frame {}: point {} is a control point off the rod: "
                                    "its place alone is held",
                                    frame, point));
}

bool FramePlan::stands() const
{
    return from_holds == to_holds && (!skeleton || from_pose.is_at(to_pose)) &&
           std::all_of(led.begin(), led.end(), [](const auto& to) { return !to; }) &&
           std::all_of(paths.begin(), paths.end(),
                       [](const HandleTrajectory& path)
                       {
                           const Motion from = path.at(0.0), to = path.at(1.0);
                           return from.R == to.R && from.t == to.t;
                       });
}

bool FramePlan::is_wound() const
{
    return std::any_of(paths.begin(), paths.end(),
                       [](const HandleTrajectory& path) { return path.is_wound(); });
}

FramePlan FramePlan::reversed(std::span<const std::size_t> regions) const
{
    FramePlan other = *this;
    for (const std::size_t r : regions)
        other.paths[r] = paths[r].reversed();
    return other;
}

std::vector<Motion> FramePlan::motions(double t) const
{
    std::vector<Motion> motions;
    for (const HandleTrajectory& path : paths)
        motions.push_back(path.at(t));
    if (!skeleton)
        return motions;
    const std::vector<Motion> of_joints = skeleton->motions(from_pose, to_pose, t);
    for (std::size_t r = 0; r < motions.size(); ++r)
        if (joint_of_region[r] >= 0)
            motions[r] = of_joints[idx(joint_of_region[r])];
    return motions;
}

FramePlan plan_frame(const FrameStatement& frame, const RegionSet& regions,
                     std::span<const Eigen::Vector3d> borders, const Units& units,
                     const RestShape& rest, const std::string& file,
                     std::span<const std::shared_ptr<const SplineState>> led,
                     StageAims& all_aims, std::vector<std::string>& warnings)
{
    const double diagonal = rest.frame.diagonal();
    // Four steps of the way. What would go through a cell in one is not seen to touch it.
    const double far =
        rest.boundary
            ? std::min(diagonal, 4.0 * kEdgesOfContact * rest.material.grid.shape().edge)
            : diagonal;
    std::vector<RegionAim>& aims = all_aims.regions;
    const SkeletonHandle* const skeleton = regions.skeleton().get();
    std::map<std::string, const Move*> moves;
    std::map<std::string, std::vector<const Move*>> moves_of_points;
    std::vector<const Move*> moves_of_joints;
    for (const Move& move : frame.moves)
        if (skeleton && skeleton->find(move.region) >= 0)
            moves_of_joints.push_back(&move);
        else if (is_of_points(move))
            moves_of_points[move.region].push_back(&move);
        else
            moves[move.region] = &move;
    FramePlan plan;
    if (skeleton)
    {
        plan.skeleton = regions.skeleton();
        plan.from_pose = all_aims.skeleton;
        plan.to_pose = all_aims.skeleton =
            skeleton->moved(plan.from_pose, moves_of_joints, units);
        plan.num_parts = skeleton->num_parts(plan.from_pose, plan.to_pose, far);
        warn_of_joints(*skeleton, plan.to_pose, frame, file, diagonal, warnings);
    }
    const Eigen::Vector3d across =
        rest.flat_axis >= 0 ? Eigen::Vector3d(rest.frame.axes.row(rest.flat_axis))
                            : Eigen::Vector3d::Zero();
    std::vector<Motion> motions;
    std::size_t next_led = 0;
    bool has_led = false;
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        const ModelBox& box = regions.box(r);
        std::vector<MoveStep> next = aims[r].steps;
        if (const auto found = moves.find(regions[r].name); found != moves.end())
        {
            const Move& move = *found->second;
            const bool is_placed = std::any_of(
                move.operations.begin(), move.operations.end(),
                [](const Operation& o) { return o.kind == Operation::Kind::To; });
            if (is_placed && regions[r].turns_freely())
                throw malformed({file, move.line, move.region},
                                "'to' needs a pin of one place; this one has " +
                                    std::to_string(regions[r].samples.size()) +
                                    " samples, use translate");
            next = steps_of(move, units, {regions.centre(r), borders[r], box.low}, file,
                            warnings);
            const double off = off_border(move, next, borders[r]);
            const bool is_first = aims[r].steps.empty();
            if (is_first && !regions[r].is_rod() && off > kFarFromBorder * diagonal)
                warnings.push_back(
                    at({file, move.line, move.region},
                       fmt::format("frame {}: turns about the middle of its box, {:.2g} "
                                   "of the diagonal off where it is attached ('about "
                                   "border' turns it there)",
                                   frame.number, off / diagonal)));
        }
        const HandleTrajectory& path = plan.paths.emplace_back(aims[r].steps, next);
        aims[r].steps = std::move(next);
        SplineHolds& from = plan.from_holds.emplace_back();
        SplineHolds& to = plan.to_holds.emplace_back();
        if (const SplineHandle* const spline = regions[r].spline.get())
        {
            from = aims[r].holds.empty() ? spline->rest_holds() : aims[r].holds;
            to = from;
            for (const Move* const move : moves_of_points[regions[r].name])
                hold_point(*move, *spline, units, file, frame.number, to);
            HeldLine line = held_line(*spline, std::move(to));
            if (line.turns_back && line.holds != from)
                warnings.push_back(
                    at({file, line_of(frame, regions[r].name), regions[r].name},
                       fmt::format("frame {}: its line turns exactly back: it could go "
                                   "round any side, more of its points tell which",
                                   frame.number)));
            aims[r].holds = to = std::move(line.holds);
            plan.num_parts = std::max(
                plan.num_parts,
                num_parts_of(*spline, from, to, std::min(far, spline->rest()->length())));
        }
        std::shared_ptr<const SplineState>& to_led = plan.led.emplace_back();
        has_led |= regions[r].is_led();
        if (regions[r].is_led() && next_led < led.size())
        {
            const SplineHandle& rod = *regions[r].spline;
            const std::shared_ptr<const SplineState> before =
                aims[r].led ? aims[r].led : rod.rest();
            to_led = aims[r].led = led[next_led++];
            plan.num_parts = std::max(plan.num_parts,
                                      parts_between(rod, *before, *to_led,
                                                    std::min(far, rod.rest()->length())));
        }
        motions.push_back(path.at(1.0));
        if (rest.flat_axis >= 0)
            for (const double t : {0.25, 0.5, 1.0})
                if (!keeps_plane(path.at(t), Eigen::Vector3d::Unit(rest.flat_axis),
                                 box.centre(), diagonal))
                    throw malformed(
                        {file, line_of(frame, regions[r].name), regions[r].name},
                        fmt::format(
                            "frame {}: leaves the plane of the model, which is flat and "
                            "is kept in it (across {:.4g} {:.4g} {:.4g}); --no-flat, or "
                            "cells.flat false, lets it bend in space",
                            frame.number, across.x(), across.y(), across.z()));
        plan.joint_of_region.push_back(
            regions[r].bone ? static_cast<int>(regions[r].bone->joint) : -1);
        if (regions[r].guide && !aims[r].is_on_guide)
        {
            aims[r].is_on_guide = true;
            plan.num_parts = std::max(
                plan.num_parts,
                parts_of_way(0.0, diagonal > 0 ? way_to_guide(regions, r, rest) / diagonal
                                               : 0.0));
        }
        if (!regions[r].prescribes() || regions[r].bone)
            continue;
        plan.num_parts = std::max(plan.num_parts, path.num_parts(box.low, box.high, far));
        if (diagonal > 0 && (motions.back()(box.centre()) - box.centre()).norm() >
                                kExtremeMove * diagonal)
            warnings.push_back(fmt::format("frame {}: {} moves by more than {} "
                                           "diagonals: the shape is stretched "
                                           "to an extreme",
                                           frame.number, regions[r].name, kExtremeMove));
    }
    plan.half_turns = half_turns_of(plan.paths);
    check_overlaps(motions, regions, rest, file, frame.line);
    if (frame.is_asked && frame.moves.empty() && !skeleton && !has_led && plan.stands())
        warnings.push_back(at({file, frame.line, ""},
                              fmt::format("frame {}: moves nothing", frame.number)));
    return plan;
}

} // namespace cellwarp::core
