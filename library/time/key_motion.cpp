// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/key_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>

#include "octree/base/half_turn.h"

namespace cellwarp::core
{

namespace
{

/// Turns about one axis [degree].
struct OneAxis
{
    Eigen::Vector3d axis;
    double from = 0.0, to = 0.0;
};

/// Two moves that turn about the same axis, one way or the other; one that does not turn
/// does so about any.
std::optional<OneAxis> one_axis(const RigidMove& a, const RigidMove& b)
{
    if (a.degrees == 0.0)
        return OneAxis{b.axis.normalized(), 0.0, b.degrees};
    const double side = a.axis.normalized().dot(b.axis.normalized());
    if (b.degrees == 0.0 || std::abs(side) > 1.0 - 1e-12)
        return OneAxis{a.axis.normalized(), a.degrees,
                       side < 0.0 ? -b.degrees : b.degrees};
    return std::nullopt;
}

/// The quaternion of a turn, with a sign: whole turns count up to two.
Eigen::Quaterniond quaternion_of(const RigidMove& move)
{
    const double degrees = std::remainder(move.degrees, 720.0);
    return Eigen::Quaterniond(
        Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, move.axis.normalized()));
}

/// From one turn to the next, which are \p R apart: axis times angle [rad]. Half a turn
/// goes round as their quaternions say, as for joints.
Eigen::Vector3d shortest_turn(const RigidMove& a, const RigidMove& b,
                              const Eigen::Matrix3d& R)
{
    const Eigen::Vector3d turn = rotation_vector(R);
    if (!is_half_turn(R))
        return turn;
    const Eigen::Vector3d told = (quaternion_of(b) * quaternion_of(a).conjugate()).vec();
    const double angle = turn.norm();
    return told.dot(turn) < 0.0
               ? Eigen::Vector3d((1.0 - 2.0 * std::numbers::pi / angle) * turn)
               : turn;
}

RigidMove scaled(RigidMove move, double share)
{
    move.translation *= share;
    move.degrees *= share;
    return move;
}

} // namespace

Motion motion_of(const RigidMove& move, const Eigen::Vector3d& about)
{
    const Eigen::Matrix3d R =
        rotation_about(move.axis.normalized(), move.degrees * std::numbers::pi / 180.0);
    return {R, about - R * about + move.translation};
}

double size_at(const SizeInTime& of, double time)
{
    if (!of.is_open(time))
        return 0.0;
    if (of.keys.empty())
        return 1.0;
    const auto next = std::find_if(of.keys.begin(), of.keys.end(),
                                   [&](const SizeKey& key) { return key.time > time; });
    if (next == of.keys.begin() || next == of.keys.end())
        return next == of.keys.end() ? of.keys.back().size : next->size;
    const SizeKey &a = *(next - 1), &b = *next;
    return a.size + (time - a.time) / (b.time - a.time) * (b.size - a.size);
}

double turned(const MoveKeys& keys, double begin, double end)
{
    double sum = 0.0;
    for (std::size_t k = 0; k + 1 < keys.size(); ++k)
    {
        const MoveKey &a = keys[k], &b = keys[k + 1];
        const double within = std::min(end, b.time) - std::max(begin, a.time);
        if (within <= 0.0)
            continue;
        const std::optional<OneAxis> one = one_axis(a.move, b.move);
        sum += within / (b.time - a.time) * (one ? std::abs(one->to - one->from) : 180.0);
    }
    return sum;
}

Motion motion_at(const MoveKeys& keys, double time, const Eigen::Vector3d& about,
                 double share)
{
    if (keys.empty())
        return {};
    const auto next = std::find_if(keys.begin(), keys.end(),
                                   [&](const MoveKey& key) { return key.time > time; });
    if (next == keys.begin() || next == keys.end())
        return motion_of(
            scaled(next == keys.end() ? keys.back().move : next->move, share), about);
    const double between_them =
        (time - (next - 1)->time) / (next->time - (next - 1)->time);
    const RigidMove a = scaled((next - 1)->move, share), b = scaled(next->move, share);
    RigidMove between;
    between.translation = a.translation + between_them * (b.translation - a.translation);
    if (const std::optional<OneAxis> one = one_axis(a, b))
    {
        between.axis = one->axis;
        between.degrees = one->from + between_them * (one->to - one->from);
        return motion_of(between, about);
    }
    // About one axis from the one to the other, by at most half a turn.
    const Motion from = motion_of(a, about), to = motion_of(b, about);
    const Eigen::Vector3d turn = shortest_turn(a, b, to.R * from.R.transpose());
    const double angle = turn.norm();
    const Eigen::Matrix3d R =
        angle > 0.0
            ? Eigen::Matrix3d(rotation_about(turn / angle, between_them * angle) * from.R)
            : from.R;
    return {R, about - R * about + between.translation};
}

} // namespace cellwarp::core
