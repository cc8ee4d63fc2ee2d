// SPDX-License-Identifier: GPL-3.0-or-later
// Squad between keys k_i, k_i+1 at a distance h in time, u = (t - t_i) / h:
//   slerp(slerp(k_i, k_i+1, u), slerp(s_i, s'_i+1, u), 2 u (1 - u)).
// Its speed at k_i, in the axes of k_i, is (a + 2 log(k_i^-1 s_i)) / h, a = log(k_i^-1
// k_i+1), and at k_i+1 (a - 2 log(k_i+1^-1 s'_i+1)) / h. With one speed w_i a key on both
// its sides,
//   s_i = k_i exp((h w_i - a) / 2),   s'_i+1 = k_i+1 exp((a - h w_i+1) / 2),
// it is C1 also where keys are not even in time; w_i is the slope of the parabola through
// three keys, in their logarithms, and at most half a turn in the longer of both spans:
// beyond that the inner points would wind. For even keys s_i = s'_i = k_i exp(-1/4
// (log(k_i^-1 k_i+1) + log(k_i^-1 k_i-1))), the textbook's. At the ends w is the slope of
// the one span. Shifts are cubic Hermite splines by the same slopes.
#include "solver/skeleton/joint_keys.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "octree/base/half_turn.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::Vector4d;

/// The least w = cos(angle / 2) of a rotation that is no half turn.
constexpr double kHalfTurnCosine = 0.5 * kHalfTurnRounding;

/// The span that a time lies in, and the share of it that has passed.
struct Place
{
    std::size_t key = 0; ///< at its begin
    double share = 0.0;
    double length = 0.0;
    bool is_between = false; ///< else the value is that of the key
};

Place place_of(const std::vector<double>& times, double time)
{
    Place place;
    if (time <= times.front())
        return place;
    place.key = static_cast<std::size_t>(
        std::upper_bound(times.begin(), times.end(), time) - times.begin() - 1);
    if (place.key + 1 == times.size() || time == times[place.key])
        return place;
    place.length = times[place.key + 1] - times[place.key];
    place.share = (time - times[place.key]) / place.length;
    place.is_between = true;
    return place;
}

/// The slope at \p key of the parabola through it and its neighbours; \p step(i): from
/// key i to i + 1.
template <class Step>
Vector3d slope(const std::vector<double>& times, std::size_t key, Step&& step)
{
    const auto length = [&](std::size_t i) { return times[i + 1] - times[i]; };
    if (key == 0)
        return step(0) / length(0);
    if (key + 1 == times.size())
        return step(key - 1) / length(key - 1);
    const double before = length(key - 1), after = length(key);
    return (after / before * step(key - 1) + before / after * step(key)) /
           (before + after);
}

/// Weights of a cubic's ends and of their tangents, which are by share.
std::array<double, 4> hermite(double u)
{
    const double v = 1.0 - u;
    return {v * v * (1.0 + 2.0 * u), u * v * v, u * u * (1.0 + 2.0 * v), -u * u * v};
}

/// Along the way that the signs tell, which may be the longer one: as they change evenly,
/// so does the way.
Quaterniond along(const Quaterniond& from, const Quaterniond& to, double u)
{
    const Quaterniond way = from.conjugate() * to;
    const double sine = way.vec().norm();
    if (sine == 0.0)
        return from;
    return from * exponential(2.0 * u * std::atan2(sine, way.w()) / sine * way.vec());
}

Quaterniond squad(const TurnKeys& keys, const Place& place)
{
    const auto& [key, u, h, is_between] = place;
    const auto step = [&](std::size_t i)
    { return logarithm(keys.turns[i].conjugate() * keys.turns[i + 1]); };
    const auto speed = [&](std::size_t i) -> Vector3d
    {
        const Vector3d w = slope(keys.times, i, step);
        double longest = 0.0;
        for (std::size_t k = i > 0 ? i - 1 : 0; k <= i && k + 1 < keys.times.size(); ++k)
            longest = std::max(longest, keys.times[k + 1] - keys.times[k]);
        return w * std::min(1.0, std::numbers::pi / (longest * w.norm()));
    };
    const Vector3d a = step(key);
    const Quaterniond &from = keys.turns[key], to = from * exponential(a);
    const Quaterniond out = from * exponential(0.5 * (h * speed(key) - a));
    const Quaterniond in = to * exponential(0.5 * (a - h * speed(key + 1)));
    return along(along(from, to, u), along(out, in, u), 2.0 * u * (1.0 - u));
}

} // namespace

Vector3d logarithm(const Quaterniond& turn)
{
    const double sine = turn.vec().norm();
    if (sine == 0.0)
        return Vector3d::Zero();
    const double sign = turn.w() < -kHalfTurnCosine ? -1.0 : 1.0;
    return sign * 2.0 * std::atan2(sine, sign * turn.w()) / sine * turn.vec();
}

Quaterniond part_of_turn(const Quaterniond& from, const Quaterniond& to, double u)
{
    return std::abs(from.dot(to)) <= kHalfTurnCosine ? along(from, to, u)
                                                     : from.slerp(u, to);
}

Quaterniond nearer_sign(const Quaterniond& before, const Quaterniond& turn)
{
    return before.dot(turn) < -kHalfTurnCosine ? Quaterniond(-turn.coeffs()) : turn;
}

Quaterniond exponential(const Vector3d& vector)
{
    const double angle = vector.norm();
    Quaterniond turn;
    turn.w() = std::cos(0.5 * angle);
    turn.vec() = (angle == 0.0 ? 0.5 : std::sin(0.5 * angle) / angle) * vector;
    return turn;
}

Quaterniond TurnKeys::at(double time) const
{
    if (times.empty())
        return Quaterniond::Identity();
    const Place place = place_of(times, time);
    const auto& [key, u, h, is_between] = place;
    if (!is_between || kind == Interpolation::Step)
        return turns[key];
    if (kind == Interpolation::Linear)
        return part_of_turn(turns[key], turns[key + 1], u).normalized();
    if (kind == Interpolation::Smooth)
        return squad(*this, place).normalized();
    const std::array<double, 4> w = hermite(u);
    const Vector4d sum = w[0] * turns[key].coeffs() + w[2] * turns[key + 1].coeffs() +
                         h * (w[1] * tangents[key][1] + w[3] * tangents[key + 1][0]);
    return sum.isZero(0) ? turns[key] : Quaterniond(sum.normalized());
}

Vector3d ShiftKeys::at(double time) const
{
    if (times.empty())
        return Vector3d::Zero();
    const Place place = place_of(times, time);
    const auto& [key, u, h, is_between] = place;
    if (!is_between || kind == Interpolation::Step)
        return shifts[key];
    if (kind == Interpolation::Linear)
        return shifts[key] + u * (shifts[key + 1] - shifts[key]);
    const auto step = [&](std::size_t i) -> Vector3d
    { return shifts[i + 1] - shifts[i]; };
    const bool is_given = kind == Interpolation::Cubic;
    const Vector3d out = is_given ? tangents[key][1] : slope(times, key, step);
    const Vector3d in = is_given ? tangents[key + 1][0] : slope(times, key + 1, step);
    const std::array<double, 4> w = hermite(u);
    return w[0] * shifts[key] + w[2] * shifts[key + 1] + h * (w[1] * out + w[3] * in);
}

} // namespace cellwarp::core
