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

/// Two keys that turn about the same axis, one way or the other; a key that does not turn
/// does so about any.
std::optional<OneAxis> one_axis(const RodKey& a, const RodKey& b)
{
    const auto axis_of = [](const RodKey& key)
    { return Eigen::Vector3d(key.rotate[0], key.rotate[1], key.rotate[2]).normalized(); };
    if (a.rotate[3] == 0.0)
        return OneAxis{axis_of(b), 0.0, b.rotate[3]};
    const double side = axis_of(a).dot(axis_of(b));
    if (b.rotate[3] == 0.0 || std::abs(side) > 1.0 - 1e-12)
        return OneAxis{axis_of(a), a.rotate[3], side < 0.0 ? -b.rotate[3] : b.rotate[3]};
    return std::nullopt;
}

/// The quaternion of a key, with a sign: whole turns count up to two.
Eigen::Quaterniond quaternion_of(const RodKey& key)
{
    const Eigen::Vector3d axis(key.rotate[0], key.rotate[1], key.rotate[2]);
    const double degrees = std::remainder(key.rotate[3], 720.0);
    return Eigen::Quaterniond(
        Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, axis.normalized()));
}

/// From one key to the next, which are \p R apart: axis times angle [rad]. Half a turn
/// goes round as the quaternions of the keys say, as for joints.
Eigen::Vector3d shortest_turn(const RodKey& a, const RodKey& b, const Eigen::Matrix3d& R)
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

} // namespace

Motion motion_of(const RodKey& key, const Eigen::Vector3d& about)
{
    const Eigen::Vector3d axis(key.rotate[0], key.rotate[1], key.rotate[2]);
    const Eigen::Matrix3d R =
        rotation_about(axis.normalized(), key.rotate[3] * std::numbers::pi / 180.0);
    return {R, about - R * about + vector_of(key.translate)};
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

double turned(const std::vector<RodKey>& keys, double begin, double end)
{
    double sum = 0.0;
    for (std::size_t k = 0; k + 1 < keys.size(); ++k)
    {
        const RodKey &a = keys[k], &b = keys[k + 1];
        const double within = std::min(end, b.time) - std::max(begin, a.time);
        if (within <= 0.0)
            continue;
        const std::optional<OneAxis> one = one_axis(a, b);
        sum += within / (b.time - a.time) * (one ? std::abs(one->to - one->from) : 180.0);
    }
    return sum;
}

Motion motion_at(std::vector<RodKey> keys, double time, const Eigen::Vector3d& about,
                 double share)
{
    for (RodKey& key : keys)
    {
        for (double& x : key.translate)
            x *= share;
        key.rotate[3] *= share;
    }
    if (keys.empty())
        return {};
    const auto next = std::find_if(keys.begin(), keys.end(),
                                   [&](const RodKey& key) { return key.time > time; });
    if (next == keys.begin())
        return motion_of(keys.front(), about);
    if (next == keys.end())
        return motion_of(keys.back(), about);
    const RodKey &a = *(next - 1), &b = *next;
    const double between_them = (time - a.time) / (b.time - a.time);
    RodKey between = a;
    for (std::size_t k = 0; k < 3; ++k)
        between.translate[k] += between_them * (b.translate[k] - a.translate[k]);
    if (const std::optional<OneAxis> one = one_axis(a, b))
    {
        for (const std::size_t k : {0u, 1u, 2u})
            between.rotate[k] = one->axis[static_cast<Eigen::Index>(k)];
        between.rotate[3] = one->from + between_them * (one->to - one->from);
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
    return {R, about - R * about + vector_of(between.translate)};
}

} // namespace cellwarp::core
