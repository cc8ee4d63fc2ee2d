// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/skeleton_handle.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <fmt/format.h>

#include "io/base/error.h"
#include "octree/base/index.h"
#include "solver/skeleton/joint_keys.h"
#include "solver/skeleton/keyed_reach.h"
#include "solver/skeleton/reach.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;

/// Squares of places do not overflow [work].
constexpr double kHuge = 1e100;

/// Places of the way at which it is measured.
constexpr int kTurnProbes = 8;

Vector3d direction(const Vector3d& vector)
{
    return (vector / vector.cwiseAbs().maxCoeff()).normalized();
}

std::vector<RestJoint> joints_of(const std::vector<SkeletonJoint>& statements,
                                 const Units& units)
{
    std::vector<RestJoint> joints;
    std::map<std::string, int> number;
    for (const SkeletonJoint& statement : statements)
    {
        RestJoint& joint = joints.emplace_back();
        joint.name = statement.name;
        if (!statement.parent.empty())
            joint.parent = number.at(statement.parent);
        number[joint.name] = static_cast<int>(joints.size()) - 1;
        joint.at = units.point(statement.at);
        if (statement.hinge)
            joint.limits.hinge = units.frame.axes * direction(*statement.hinge);
        if (statement.twist)
            joint.limits.twist = {(*statement.twist)[0] * kDegree,
                                  (*statement.twist)[1] * kDegree};
        if (statement.swing)
            joint.limits.swing = *statement.swing * kDegree;
    }
    return joints;
}

SkeletonPose pose_of(const SkeletonAim& aim)
{
    return {aim.turns, aim.shifts};
}

Interpolation interpolation_of(KeyStep step)
{
    switch (step)
    {
    case KeyStep::Hold:
        return Interpolation::Step;
    case KeyStep::Linear:
        return Interpolation::Linear;
    case KeyStep::Smooth:
        return Interpolation::Smooth;
    case KeyStep::Cubic:
        return Interpolation::Cubic;
    }
    return Interpolation::Linear;
}

ShiftKeys shift_keys(const KeyTrack<3>& track)
{
    return {interpolation_of(track.step), track.times, track.values, track.tangents};
}

/// \p keyed: the pose that the other tracks make at a time.
KeyedReach reach_of(const SkeletonValues& values, const KeyedReach::Keyed& keyed)
{
    Skeleton skeleton(joints_of(values.joints, {}));
    std::vector<KeyedPlace> places;
    for (const ReachTrack& track : values.reaches)
    {
        KeyedPlace& place = places.emplace_back();
        place.joint = static_cast<int>(track.joint);
        place.chain.assign(track.chain.begin(), track.chain.end());
        if (place.chain.empty())
            place.chain = usual_chain(skeleton, place.joint);
        place.places = shift_keys(track);
        place.is_hold = track.is_hold;
    }
    std::vector<std::size_t> keyed_joints;
    for (const TurnTrack& track : values.turns)
        keyed_joints.push_back(track.joint);
    return {std::move(skeleton), std::move(places), keyed_joints, key_times(values),
            keyed};
}

/// Frames of one scene: each of them is a list of moves.
constexpr double kMostFrames = 100000;

std::vector<double> frame_times(const SkeletonValues& skeleton,
                                std::optional<double> every, const std::string& file)
{
    std::vector<double> times = key_times(skeleton);
    if (!every || times.empty())
        return times;
    const double first = times.front(), last = times.back();
    // A hair of tolerance: whatever the rounding, the last key has one frame.
    const double count = std::ceil((last - first) / *every - 1e-6);
    if (!(count < kMostFrames))
        throw malformed({file, 0, "skeleton.every"},
                        "makes more than " +
                            std::to_string(static_cast<int>(kMostFrames)) + " frames");
    times.clear();
    for (int k = 0; k < static_cast<int>(count); ++k)
        times.push_back(first + k * *every);
    times.push_back(last);
    return times;
}

Operation turn_operation(const Quaterniond& turn)
{
    Operation operation;
    operation.kind = Operation::Kind::Rotate;
    // Beyond half a turn as the sign says: so half a turn from there goes on.
    const double sine = turn.vec().norm();
    operation.move.degrees = 2.0 * std::atan2(sine, turn.w()) / kDegree;
    operation.move.axis = sine > 1e-15 ? Vector3d(turn.vec() / sine) : Vector3d::UnitZ();
    return operation;
}

/// Signs of quaternions that lead the shortest way from key to key, from at most half a
/// turn on. Given tangents are of the signs that the keys have: all change alike.
void align_signs(TurnKeys& keys)
{
    const auto flip = [](Quaterniond& turn) { turn.coeffs() = -turn.coeffs(); };
    if (keys.kind == Interpolation::Cubic)
    {
        if (keys.turns.empty() || keys.turns.front().w() >= 0.0)
            return;
        std::for_each(keys.turns.begin(), keys.turns.end(), flip);
        for (auto& [before, after] : keys.tangents)
        {
            before = -before;
            after = -after;
        }
        return;
    }
    Quaterniond before = Quaterniond::Identity();
    for (Quaterniond& turn : keys.turns)
        before = turn = nearer_sign(before, turn);
}

} // namespace

bool SkeletonAim::is_at(const SkeletonAim& other) const
{
    return shifts == other.shifts &&
           std::equal(turns.begin(), turns.end(), other.turns.begin(), other.turns.end(),
                      [](const Quaterniond& a, const Quaterniond& b)
                      { return a.coeffs() == b.coeffs(); });
}

SkeletonHandle::SkeletonHandle(const std::vector<SkeletonJoint>& joints,
                               const Units& units, std::string file)
    : file_(std::move(file)), statements_(joints), skeleton_(joints_of(joints, units)),
      unit_(units.is_relative ? units.box.size().norm() : 1.0),
      exponent_(units.frame.exponent)
{
}

std::optional<double> SkeletonHandle::told_radius(std::size_t joint) const
{
    const std::optional<double>& radius = statements_[joint].radius;
    return radius ? std::optional(std::ldexp(*radius * unit_, exponent_)) : std::nullopt;
}

SkeletonAim SkeletonHandle::rest() const
{
    SkeletonPose rest = skeleton_.rest();
    return {std::move(rest.turns), std::move(rest.shifts), {}, 0};
}

SkeletonAim SkeletonHandle::moved(const SkeletonAim& from,
                                  std::span<const Move* const> moves,
                                  const Units& units) const
{
    SkeletonAim to = from;
    std::set<int> told;
    for (const Move* const move : moves)
        apply(*move, units, to, told);
    SkeletonPose pose = pose_of(to);
    to.limited = skeleton_.limit(pose);
    std::vector<ReachTarget> targets;
    for (const JointHold& hold : to.holds)
    {
        ReachTarget& target = targets.emplace_back();
        target.joint = hold.joint;
        target.place = hold.place;
        for (const int joint : hold.chain)
            if (!told.contains(joint))
                target.chain.push_back(joint);
    }
    if (!targets.empty())
    {
        const ReachReport report = reach(skeleton_, targets, pose);
        for (std::size_t k = 0; k < targets.size(); ++k)
            to.holds[k].miss = report.misses[k];
    }
    to.turns = std::move(pose.turns);
    return to;
}

std::vector<Motion> SkeletonHandle::motions(const SkeletonAim& from,
                                            const SkeletonAim& to, double t) const
{
    return skeleton_.motions(between(pose_of(from), pose_of(to), t));
}

int SkeletonHandle::num_parts(const SkeletonAim& from, const SkeletonAim& to,
                              double diagonal) const
{
    if (from.is_at(to))
        return 1;
    std::vector<double> turns(size(), 0.0), ways(size(), 0.0);
    std::vector<Motion> last = motions(from, to, 0.0);
    for (int probe = 1; probe <= kTurnProbes; ++probe)
    {
        const std::vector<Motion> next =
            motions(from, to, static_cast<double>(probe) / kTurnProbes);
        for (std::size_t j = 0; j < size(); ++j)
        {
            turns[j] += rotation_vector(next[j].R * last[j].R.transpose()).norm();
            ways[j] += (next[j](place(j)) - last[j](place(j))).norm();
        }
        last = next;
    }
    const double way = *std::max_element(ways.begin(), ways.end());
    return parts_of_way(*std::max_element(turns.begin(), turns.end()),
                        diagonal > 0 ? way / diagonal : 0.0);
}

void SkeletonHandle::apply(const Move& move, const Units& units, SkeletonAim& to,
                           std::set<int>& told) const
{
    const int joint = find(move.region);
    const auto hold = std::find_if(to.holds.begin(), to.holds.end(),
                                   [&](const JointHold& h) { return h.joint == joint; });
    if (move.released)
    {
        if (hold != to.holds.end())
            to.holds.erase(hold);
        return;
    }
    if (move.operations.front().kind == Operation::Kind::To)
    {
        JointHold held{joint, units.point(move.operations.front().vector),
                       chain_of(joint, move.chain), 0.0};
        if (!(held.place.cwiseAbs().maxCoeff() <= kHuge))
            throw malformed({file_, move.line, move.region},
                            "moves beyond what numbers can hold");
        if (hold == to.holds.end())
            to.holds.push_back(std::move(held));
        else
            *hold = std::move(held);
        return;
    }
    Quaterniond turn = Quaterniond::Identity();
    Vector3d shift = Vector3d::Zero();
    bool turns = false, shifts = false;
    for (const Operation& operation : move.operations)
        if (operation.kind == Operation::Kind::Rotate)
        {
            turns = true;
            turn = Quaterniond(Eigen::AngleAxisd(
                       std::remainder(operation.move.degrees, 720.0) * kDegree,
                       units.frame.axes * direction(operation.move.axis))) *
                   turn;
        }
        else
        {
            shifts = true;
            shift += units.vector(operation.move.translation);
        }
    // What a move does not speak of it does not keep either: moves are absolute.
    to.turns[idx(joint)] = turn.normalized();
    to.shifts[idx(joint)] = shift;
    if (turns || !shifts)
        told.insert(joint);
    if (!to.shifts[idx(joint)].allFinite())
        throw malformed({file_, move.line, move.region},
                        "moves beyond what numbers can hold");
}

std::vector<int> SkeletonHandle::chain_of(int joint, const std::string& first) const
{
    if (first.empty())
        return usual_chain(skeleton_, joint);
    std::vector<int> chain;
    for (int above = skeleton_[idx(joint)].parent; above >= 0;
         above = skeleton_[idx(above)].parent)
    {
        chain.push_back(above);
        if (skeleton_[idx(above)].name == first)
            break;
    }
    return chain;
}

struct KeyedJoints::Tracks
{
    std::vector<std::string> names; ///< of the joints
    std::vector<std::pair<std::size_t, TurnKeys>> turns;
    std::vector<std::pair<std::size_t, ShiftKeys>> shifts;
    std::optional<KeyedReach> reach; ///< none: no joint reaches a place
    /// Joints that reach places, and their fields in the scene.
    std::vector<std::pair<std::size_t, std::string>> reached;

    SkeletonPose pose_at(double time) const
    {
        SkeletonPose pose{{names.size(), Quaterniond::Identity()},
                          {names.size(), Vector3d::Zero()}};
        for (const auto& [joint, keys] : turns)
            pose.turns[joint] = keys.at(time);
        for (const auto& [joint, keys] : shifts)
            pose.shifts[joint] = keys.at(time);
        if (reach)
            reach->solve(time, pose);
        return pose;
    }
};

KeyedJoints::KeyedJoints(const SkeletonValues& skeleton)
{
    const auto tracks = std::make_shared<Tracks>();
    for (const SkeletonJoint& joint : skeleton.joints)
        tracks->names.push_back(joint.name);
    for (const TurnTrack& track : skeleton.turns)
    {
        auto& [joint, keys] = tracks->turns.emplace_back();
        joint = track.joint;
        keys.kind = interpolation_of(track.step);
        keys.times = track.times;
        keys.tangents = track.tangents;
        for (const Eigen::Vector4d& value : track.values)
            keys.turns.emplace_back(value);
        align_signs(keys);
    }
    for (const ShiftTrack& track : skeleton.shifts)
        tracks->shifts.emplace_back(track.joint, shift_keys(track));
    if (!skeleton.reaches.empty())
    {
        const auto keyed = [&tracks](double time) { return tracks->pose_at(time); };
        KeyedReach reach = reach_of(skeleton, keyed);
        tracks->reach.emplace(std::move(reach));
        for (const ReachTrack& track : skeleton.reaches)
            tracks->reached.emplace_back(track.joint, track.field);
    }
    tracks_ = tracks;
}

std::vector<Move> KeyedJoints::moves_at(double time) const
{
    const SkeletonPose pose = tracks_->pose_at(time);
    std::map<std::size_t, Move> moves;
    const auto move_of = [&](std::size_t joint) -> Move&
    {
        Move& move = moves[joint];
        move.region = tracks_->names[joint];
        return move;
    };
    std::set<std::size_t> turned;
    for (const auto& [joint, keys] : tracks_->turns)
        turned.insert(joint);
    if (tracks_->reach)
        turned.insert(tracks_->reach->joints().begin(), tracks_->reach->joints().end());
    for (const std::size_t joint : turned)
        move_of(joint).operations.push_back(turn_operation(pose.turns[joint]));
    for (const auto& [joint, keys] : tracks_->shifts)
    {
        Operation operation;
        operation.move.translation = pose.shifts[joint];
        move_of(joint).operations.push_back(operation);
    }
    std::vector<Move> out;
    for (auto& [joint, move] : moves)
        out.push_back(std::move(move));
    return out;
}

std::vector<JointMotion> KeyedJoints::motions_at(double time) const
{
    const SkeletonPose pose = tracks_->pose_at(time);
    std::vector<JointMotion> motions;
    for (std::size_t joint = 0; joint < pose.turns.size(); ++joint)
        motions.push_back({pose.turns[joint], pose.shifts[joint]});
    return motions;
}

std::vector<std::string> KeyedJoints::warnings(const std::string& file) const
{
    std::vector<std::string> out;
    for (std::size_t k = 0; k < tracks_->reached.size(); ++k)
    {
        const auto& [joint, field] = tracks_->reached[k];
        const KeyedReach::Miss& miss = tracks_->reach->misses()[k];
        if (miss.distance > KeyedReach::kReached)
            out.push_back(
                at({file, 0, field},
                   fmt::format("joint {} ends up to {:.3g} of the skeleton's "
                               "size from its place, which is out of reach "
                               "(at {:.4g} s)",
                               tracks_->names[joint], miss.distance, miss.time)));
    }
    return out;
}

std::vector<double> key_times(const SkeletonValues& skeleton)
{
    std::set<double> times;
    for (const TurnTrack& track : skeleton.turns)
        times.insert(track.times.begin(), track.times.end());
    for (const ShiftTrack& track : skeleton.shifts)
        times.insert(track.times.begin(), track.times.end());
    for (const ReachTrack& track : skeleton.reaches)
        times.insert(track.times.begin(), track.times.end());
    return {times.begin(), times.end()};
}

std::vector<FrameStatement> posed_frames(const SkeletonValues& skeleton,
                                         std::optional<double> every,
                                         const std::string& file,
                                         std::vector<std::string>& warnings)
{
    const KeyedJoints joints(skeleton);
    for (std::string& warning : joints.warnings(file))
        warnings.push_back(std::move(warning));
    std::vector<FrameStatement> frames;
    for (const double time : frame_times(skeleton, every, file))
    {
        FrameStatement& frame = frames.emplace_back();
        frame.number = static_cast<std::int64_t>(frames.size());
        frame.time = time;
        frame.moves = joints.moves_at(time);
    }
    return frames;
}

} // namespace cellwarp::core
