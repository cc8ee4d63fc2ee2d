// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/edited_region.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "library/session/frame_plan.h"
#include "library/session/regions.h"
#include "library/session/spline_holds.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// How far the first of two frames turns about a new axis: clear of half a turn, where
/// the shortest way could go either way round.
constexpr double kFirstTurn = 120.0;

/// A turn, a shift, or the one and then the other: a placement can be read from them as
/// it was written.
bool is_plain(const std::vector<Operation>& operations)
{
    using Kind = Operation::Kind;
    const auto is = [&](std::size_t k, Kind kind) { return operations[k].kind == kind; };
    return (operations.size() == 1 && (is(0, Kind::Translate) || is(0, Kind::Rotate))) ||
           (operations.size() == 2 && is(0, Kind::Rotate) && is(1, Kind::Translate));
}

/// From the file's units.
Eigen::Vector3d model_vector(const Eigen::Vector3d& given, const Units& units)
{
    return units.is_relative ? Eigen::Vector3d(given.cwiseProduct(units.box.size()))
                             : given;
}

/// Into the file's units; a flat axis has none to move along.
Eigen::Vector3d given_vector(const Eigen::Vector3d& model, const Units& units)
{
    if (!units.is_relative)
        return model;
    Eigen::Vector3d given = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
        if (units.box.size()[k] > 0)
            given[k] = model[k] / units.box.size()[k];
    return given;
}

Eigen::Vector3d unit(const Eigen::Vector3d& axis)
{
    return (axis / axis.cwiseAbs().maxCoeff()).normalized();
}

/// A point from the model's unit into the file's, and back.
Eigen::Vector3d given_point(const Eigen::Vector3d& model, const Units& units)
{
    return units.is_relative ? given_vector(model - units.box.low, units) : model;
}

Eigen::Vector3d model_point(const Eigen::Vector3d& given, const Units& units)
{
    return units.is_relative ? Eigen::Vector3d(units.box.low + model_vector(given, units))
                             : given;
}

Operation rotation(const RigidMove& to, const RegionGround& ground)
{
    Operation operation;
    operation.kind = Operation::Kind::Rotate;
    operation.move.axis = to.axis;
    operation.move.degrees = to.degrees;
    if (to.pivot)
        operation.move.pivot = given_point(*to.pivot, ground.units);
    return operation;
}

Operation translation(const RigidMove& to, const RegionGround& ground)
{
    Operation operation;
    operation.move.translation = given_vector(to.translation, ground.units);
    return operation;
}

FrameStatement frame_to(const EditedRegion& region, const RigidMove& to,
                        std::int64_t number, const RegionGround& ground)
{
    Move move;
    move.region = region.name;
    if (to.degrees != 0.0 || region.placement.degrees != 0.0)
        move.operations.push_back(rotation(to, ground));
    move.operations.push_back(translation(to, ground));
    return {number, {move}, 0};
}

} // namespace

Selector selector_of(const std::vector<std::uint32_t>& samples)
{
    Selector selector;
    selector.kind = Selector::Kind::Indices;
    for (const std::uint32_t i : samples)
    {
        if (!selector.ranges.empty() && selector.ranges.back().second + 1 == i)
            ++selector.ranges.back().second;
        else
            selector.ranges.emplace_back(i, i);
    }
    return selector;
}

std::vector<EditedRegion> edited_regions(const std::vector<RegionStatement>& statements,
                                         const RegionGround& ground)
{
    std::vector<EditedRegion> regions;
    for (Region& region : resolve_regions(statements, ground.geometry, ground.rest,
                                          ground.units, ground.file, &ground.coincident))
    {
        EditedRegion& edited = regions.emplace_back();
        edited.name = std::move(region.name);
        edited.role = region.role;
        edited.factor = region.factor;
        edited.samples = std::move(region.samples);
        edited.centre = region.centre;
        edited.knows_samples = ground.is_known || region.shapes.empty();
        edited.spline = std::move(region.spline);
        edited.frame = ground.units.frame;
        edited.line = std::move(region.told);
    }
    return regions;
}

namespace
{

/// As a turn about the centre and a shift.
RigidMove placement_by(const Motion& motion, const Eigen::Vector3d& centre,
                       const WorkFrame& frame)
{
    RigidMove placement;
    placement.translation = frame.vector_to_model(motion(centre) - centre);
    const Eigen::AngleAxisd turn(
        Eigen::Matrix3d(frame.axes.transpose() * motion.R * frame.axes));
    if (turn.angle() != 0.0)
    {
        placement.axis = turn.axis();
        placement.degrees = turn.angle() * 180.0 / std::numbers::pi;
    }
    return placement;
}

} // namespace

RigidMove placement_of(const Move& move, const EditedRegion& region,
                       const RegionGround& ground)
{
    RigidMove placement;
    if (is_plain(move.operations))
    {
        for (const Operation& operation : move.operations)
            if (operation.kind == Operation::Kind::Rotate)
            {
                const RigidMove& turn = operation.move;
                placement.axis = unit(turn.axis);
                placement.degrees = turn.degrees;
                placement.pivot =
                    operation.is_about_border ? region.border
                    : turn.pivot ? std::optional(model_point(*turn.pivot, ground.units))
                                 : std::nullopt;
            }
            else
                placement.translation =
                    model_vector(operation.move.translation, ground.units);
        return placement;
    }
    const WorkFrame& frame = ground.units.frame;
    const Eigen::Vector3d centre = frame.to_work(region.centre);
    std::vector<std::string> warnings;
    const Eigen::Vector3d border = region.border ? frame.to_work(*region.border) : centre;
    const std::vector<MoveStep> steps = steps_of(
        move, ground.units, {centre, border, centre}, ground.file.path, warnings);
    return placement_by(motion_of(steps), centre, frame);
}

bool is_placed_anywhere(const Move& move, const RegionGround& ground)
{
    return is_plain(move.operations) && !ground.units.is_relative;
}

bool turns_about_border(const Move& move)
{
    return std::any_of(move.operations.begin(), move.operations.end(),
                       [](const Operation& o) { return o.is_about_border; });
}

std::vector<EditedPoint> points_of(const EditedRegion& region,
                                   const std::vector<FrameStatement>& frames,
                                   const RegionGround& ground)
{
    std::vector<EditedPoint> points;
    if (!region.spline)
        return points;
    const SplineHandle& spline = *region.spline;
    const SplineHolds rest = spline.rest_holds();
    SplineHolds holds = rest;
    for (const FrameStatement& frame : frames)
        for (const Move& move : frame.moves)
            if (move.region == region.name && is_of_points(move))
                hold_point(move, spline, ground.units, ground.file.path, frame.number,
                           holds);
    const WorkFrame& work = ground.units.frame;
    for (std::size_t k = 0; k < holds.size(); ++k)
        points.push_back({work.to_model(rest[k].place), work.to_model(holds[k].place),
                          work.axes.transpose() * holds[k].tangent,
                          holds[k].turn * 180.0 / std::numbers::pi, holds[k].parts,
                          holds[k].is_told, spline.has_frame_at(k)});
    return points;
}

SplineHolds holds_of(const EditedRegion& region, const SplineHandle& spline,
                     const WorkFrame& frame)
{
    SplineHolds holds = spline.rest_holds();
    for (std::size_t k = 0; k < holds.size(); ++k)
    {
        const EditedPoint& point = region.points[k];
        holds[k].parts = point.parts;
        if (point.place != point.rest)
            holds[k].place = frame.to_work(point.place);
        holds[k].tangent = frame.axes * point.tangent;
        holds[k].turn = point.degrees * std::numbers::pi / 180.0;
        holds[k].is_told = point.is_told;
    }
    return held_line(spline, std::move(holds)).holds;
}

EditedPoint moved(EditedPoint point, const PointPlacement& to)
{
    if (to.place)
    {
        point.place = *to.place;
        point.parts.place = true;
    }
    if (to.degrees)
    {
        point.degrees = *to.degrees;
        point.parts.twist = true;
    }
    return point;
}

namespace
{

Move move_of(const EditedRegion& region, std::size_t point)
{
    Move move;
    move.region = region.name;
    move.place = {MovePlace::Kind::Point, static_cast<std::int64_t>(point)};
    return move;
}

} // namespace

FrameStatement frame_of_point(const EditedRegion& region, std::size_t point,
                              const PointPlacement& to, std::int64_t number,
                              const RegionGround& ground)
{
    Move move = move_of(region, point);
    if (to.place)
    {
        Operation& operation = move.operations.emplace_back();
        operation.kind = Operation::Kind::To;
        operation.vector = given_point(*to.place, ground.units);
    }
    if (to.degrees)
    {
        Operation& operation = move.operations.emplace_back();
        operation.kind = Operation::Kind::Turn;
        operation.move.degrees = *to.degrees;
    }
    return {number, {move}, 0};
}

FrameStatement frame_of_release(const EditedRegion& region, std::size_t point,
                                const HoldParts& parts, std::int64_t number)
{
    Move move = move_of(region, point);
    move.released = parts;
    return {number, {move}, 0};
}

RodShape shape_of(const EditedRegion& region)
{
    RodShape shape;
    for (const EditedPoint& point : region.points)
        shape.points.push_back(point.rest);
    shape.is_closed = region.line->is_closed;
    if (!region.line->radii.empty())
        shape.radius = region.frame.length_to_model(region.spline->radius());
    shape.stiffness = region.line->stiffness;
    return shape;
}

SplineStatement line_of(const RodShape& shape, Role role, const RegionGround& ground,
                        SplineStatement like)
{
    if (like.form == SplineStatement::Form::Skeleton)
        like.form = SplineStatement::Form::Through;
    like.near.clear();
    like.points.clear();
    for (const Eigen::Vector3d& point : shape.points)
        like.points.push_back(given_point(point, ground.units));
    like.is_closed = shape.is_closed;
    like.radii.clear();
    if (role == Role::Rod && shape.radius)
        like.radii = {ground.units.is_relative
                          ? *shape.radius / ground.units.box.size().norm()
                          : *shape.radius};
    like.stiffness = role == Role::Rod ? shape.stiffness : std::nullopt;
    return like;
}

Motion motion_of(const RigidMove& placement, const Eigen::Vector3d& centre,
                 const WorkFrame& frame)
{
    RigidMove turn, shift;
    turn.axis = frame.axes * placement.axis;
    turn.degrees = placement.degrees;
    turn.pivot = frame.to_work(placement.pivot.value_or(centre));
    shift.translation = frame.vector_to_work(placement.translation);
    return motion_of(std::vector<MoveStep>{turn, shift});
}

Motion motion_of(const EditedRegion& region)
{
    return motion_of(region.placement, region.centre, WorkFrame());
}

bool can_tell(const Eigen::Vector3d& place, const Units& units)
{
    const Eigen::Array3d size = units.box.size();
    return !units.is_relative ||
           (size > 0.0 || place.array() == units.box.low.array()).all();
}

RigidMove about(const Eigen::Vector3d& pivot, const EditedRegion& region)
{
    RigidMove placement = region.placement;
    if (pivot == region.pivot())
        return placement;
    placement.pivot.reset();
    if (pivot != region.centre)
        placement.pivot = pivot;
    if (placement.degrees != 0.0)
        placement.translation = motion_of(region)(pivot) - pivot;
    return placement;
}

bool is_at(const EditedRegion& region, const RigidMove& placement)
{
    return placement == about(placement.pivot.value_or(region.centre), region);
}

Eigen::Vector3d before_motion(const EditedRegion& region, const Eigen::Vector3d& place)
{
    return inverse(motion_of(region))(place);
}

std::vector<EditedRegion> edited_joints(const SkeletonHandle& skeleton,
                                        const SkeletonAim& aim,
                                        const RegionGround& ground)
{
    const WorkFrame& frame = ground.units.frame;
    const std::vector<Motion> motions = skeleton.motions(aim, aim, 1.0);
    std::vector<EditedRegion> joints;
    for (std::size_t j = 0; j < skeleton.size(); ++j)
    {
        EditedRegion& joint = joints.emplace_back();
        joint.name = skeleton.statement(j).name;
        joint.role = Role::Bone;
        joint.centre = frame.to_model(skeleton.place(j));
        joint.frame = frame;
        joint.knows_placement = ground.is_known;
        joint.placement = placement_by(motions[j], skeleton.place(j), frame);
        joint.joint.emplace();
        joint.joint->is_root = skeleton.parent(j) < 0;
        if (!joint.joint->is_root)
            joint.joint->turn_above =
                frame.axes.transpose() * motions[idx(skeleton.parent(j))].R * frame.axes;
        for (const JointHold& hold : aim.holds)
            joint.joint->is_held |= hold.joint == static_cast<int>(j);
    }
    return joints;
}

Move joint_move(const EditedRegion& joint, const RigidMove& to,
                const RegionGround& ground)
{
    Move move;
    move.region = joint.name;
    const bool is_rest = to == RigidMove(); // of its own turn, wherever the others are
    if (!is_rest && !joint.joint->is_root &&
        to.translation != joint.placement.translation)
    {
        Operation& operation = move.operations.emplace_back();
        operation.kind = Operation::Kind::To;
        operation.vector = given_point(joint.centre + to.translation, ground.units);
        return move;
    }
    Eigen::Matrix3d own = Eigen::Matrix3d::Identity();
    if (!is_rest)
        own =
            joint.joint->turn_above.transpose() *
            Eigen::AngleAxisd(to.degrees * std::numbers::pi / 180.0, to.axis.normalized())
                .toRotationMatrix();
    const Eigen::AngleAxisd turn(own);
    Operation& operation = move.operations.emplace_back();
    operation.kind = Operation::Kind::Rotate;
    operation.move.axis = turn.axis();
    operation.move.degrees = turn.angle() * 180.0 / std::numbers::pi;
    if (joint.joint->is_root)
        move.operations.push_back(translation(to, ground));
    return move;
}

std::vector<FrameStatement> frames_to(const EditedRegion& region, const RigidMove& to,
                                      std::int64_t number, const RegionGround& ground)
{
    if (region.joint)
        return {{number, {joint_move(region, to, ground)}, 0}};
    std::vector<FrameStatement> frames;
    // Told as a turn about the same place as the new one.
    const RigidMove from = about(to.pivot.value_or(region.centre), region);
    // The way is clear where the operations are the same as before: from rest they are.
    const bool is_new_axis = from.degrees == 0.0
                                 ? from.translation != RigidMove().translation
                                 : from.axis != to.axis;
    EditedRegion on_the_way = region;
    if (!is_new_axis && from.degrees != 0.0 && from != region.placement)
    {
        // It stands still while its pivot changes: between two pivots it would swerve.
        frames.push_back(frame_to(region, from, number++, ground));
        on_the_way.placement = from;
    }
    if (is_new_axis && std::abs(to.degrees) > 180.0)
    {
        on_the_way.placement = to;
        on_the_way.placement.degrees = std::copysign(kFirstTurn, to.degrees);
        on_the_way.placement.translation = 0.5 * (from.translation + to.translation);
        frames.push_back(frame_to(region, on_the_way.placement, number++, ground));
    }
    frames.push_back(frame_to(on_the_way, to, number, ground));
    return frames;
}

} // namespace cellwarp::core
