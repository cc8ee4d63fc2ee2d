// SPDX-License-Identifier: GPL-3.0-or-later
// Let C_j be the rotation of the frame at station j, from rest. Its bend and twist
// against the next station is B_j = C_j^T C_j+1 = exp b_j, a small turn. On the way
//   C_j+1(t) = C_j(t) exp((1 - t) b_j + t b'_j),
// from the station that turns least, which goes by the shortest turn. A circle of any
// angle bends evenly so, and whole turns are counted.
//
// The smoothest shift between places with shifts x_i at s_i, h_i = s_i+1 - s_i, has the
// slopes m_i of a cubic spline,
//   m_i-1 / h_i-1 + 2 (1 / h_i-1 + 1 / h_i) m_i + m_i+1 / h_i
//     = 3 ((x_i - x_i-1) / h_i-1^2 + (x_i+1 - x_i) / h_i^2),
// but where a slope is told; at an end without one 2 m_0 + m_1 = 3 (x_1 - x_0) / h_0.
#include "library/session/line_bending.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "octree/base/half_turn.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Steps in which a way is looked at: finer than whole turns that a frame may make.
constexpr int kProbes = 32;

Matrix3d exponential(const Vector3d& vector)
{
    const double angle = vector.norm();
    return angle == 0.0 ? Matrix3d(Matrix3d::Identity())
                        : rotation_about(vector / angle, angle);
}

Matrix3d orthonormal(const Matrix3d& R)
{
    return Eigen::Quaterniond(R).normalized().toRotationMatrix();
}

Eigen::Matrix3Xd bends_of(const std::vector<Matrix3d>& turns)
{
    Eigen::Matrix3Xd bends(3, static_cast<Eigen::Index>(turns.size()) - 1);
    for (Eigen::Index k = 0; k < bends.cols(); ++k)
        bends.col(k) = rotation_vector(turns[static_cast<std::size_t>(k)].transpose() *
                                       turns[static_cast<std::size_t>(k) + 1]);
    return bends;
}

double angle_between(const Matrix3d& a, const Matrix3d& b)
{
    return rotation_vector(b * a.transpose()).norm();
}

/// A direction across a unit vector.
Vector3d any_across(const Vector3d& direction)
{
    return direction.unitOrthogonal();
}

} // namespace

LineBending::LineBending(std::vector<Matrix3d> from, std::vector<Matrix3d> to)
    : from_(std::move(from)), to_(std::move(to)), from_bend_(bends_of(from_)),
      to_bend_(bends_of(to_))
{
    assert(!from_.empty() && from_.size() == to_.size());
    constexpr double kSame = 1e-9; // [rad]
    double least = 4.0;
    for (std::size_t k = 0; k < from_.size(); ++k)
        if (const double angle = angle_between(from_[k], to_[k]); angle < least - kSame)
        {
            least = angle;
            anchor_ = k;
        }
    anchor_turn_ = rotation_vector(to_[anchor_] * from_[anchor_].transpose());
}

std::vector<Matrix3d> LineBending::at(double t) const
{
    if (t <= 0.0)
        return from_;
    if (t >= 1.0)
        return to_;
    std::vector<Matrix3d> turns(from_.size());
    turns[anchor_] = exponential(t * anchor_turn_) * from_[anchor_];
    const auto bend = [&](std::size_t k) -> Matrix3d
    {
        const Eigen::Index column = static_cast<Eigen::Index>(k);
        return exponential((1.0 - t) * from_bend_.col(column) + t * to_bend_.col(column));
    };
    for (std::size_t k = anchor_; k + 1 < turns.size(); ++k)
        turns[k + 1] = orthonormal(turns[k] * bend(k));
    for (std::size_t k = anchor_; k-- > 0;)
        turns[k] = orthonormal(turns[k + 1] * bend(k).transpose());
    return turns;
}

std::vector<double> LineBending::turns() const
{
    std::vector<double> sums(from_.size(), 0.0);
    std::vector<Matrix3d> last = from_;
    for (int probe = 1; probe <= kProbes; ++probe)
    {
        std::vector<Matrix3d> next = at(static_cast<double>(probe) / kProbes);
        for (std::size_t k = 0; k < sums.size(); ++k)
            sums[k] += angle_between(last[k], next[k]);
        last = std::move(next);
    }
    return sums;
}

std::vector<double> LineBending::largest_turns() const
{
    std::vector<double> largest(from_.size(), 0.0);
    for (int probe = 1; probe <= kProbes; ++probe)
    {
        const std::vector<Matrix3d> now = at(static_cast<double>(probe) / kProbes);
        for (std::size_t k = 0; k < largest.size(); ++k)
            largest[k] = std::max(largest[k], angle_between(from_[k], now[k]));
    }
    return largest;
}

bool are_opposite(const Vector3d& from, const Vector3d& to)
{
    return from.dot(to) < 0.0 && from.cross(to).norm() <= kHalfTurnRounding;
}

Matrix3d shortest_turn(const Vector3d& from, const Vector3d& to, const Vector3d& across)
{
    if (!are_opposite(from, to))
        return Eigen::Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
    // Half a turn, and the hair that is missing.
    const Matrix3d half = rotation_about(across, std::numbers::pi);
    return Eigen::Quaterniond::FromTwoVectors(half * from, to).toRotationMatrix() * half;
}

namespace
{

/// Slopes of the smoothest shift at the places of \p told that have one.
Eigen::MatrixX3d slopes_of(std::span<const ToldPlace> nodes,
                           std::span<const Vector3d> rest_directions)
{
    const Eigen::Index count = static_cast<Eigen::Index>(nodes.size());
    Eigen::MatrixXd system = Eigen::MatrixXd::Zero(count, count);
    Eigen::MatrixX3d right = Eigen::MatrixX3d::Zero(count, 3);
    for (Eigen::Index i = 0; i < count; ++i)
    {
        const std::size_t k = static_cast<std::size_t>(i);
        if (nodes[k].has_direction)
        {
            system(i, i) = 1.0;
            right.row(i) = (nodes[k].direction - rest_directions[k]).transpose();
            continue;
        }
        for (const Eigen::Index side : {Eigen::Index(-1), Eigen::Index(1)})
        {
            if (i + side < 0 || i + side >= count)
                continue;
            const ToldPlace& other = nodes[static_cast<std::size_t>(i + side)];
            const double h = std::abs(other.s - nodes[k].s);
            system(i, i) += 2.0 / h;
            system(i, i + side) += 1.0 / h;
            right.row(i) += 3.0 * static_cast<double>(side) / (h * h) *
                            (other.shift - nodes[k].shift).transpose();
        }
    }
    return Eigen::PartialPivLU<Eigen::MatrixXd>(system).solve(right);
}

const LineStation& station_at(std::span<const LineStation> rest, double s)
{
    return *std::min_element(rest.begin(), rest.end(),
                             [s](const LineStation& a, const LineStation& b)
                             { return std::abs(a.s - s) < std::abs(b.s - s); });
}

/// From each told direction on this direction, as a turn of that of rest.
std::vector<Vector3d> directions_alone(std::span<const LineStation> rest,
                                       std::span<const ToldPlace> told)
{
    Matrix3d turn = Matrix3d::Identity();
    std::vector<Vector3d> directions;
    const auto turn_to = [&](const ToldPlace& place)
    {
        const Vector3d now = turn * station_at(rest, place.s).direction;
        turn = shortest_turn(now, place.direction, any_across(now)) * turn;
    };
    auto next = told.begin();
    const auto find_next = [&]
    {
        next = std::find_if(next, told.end(),
                            [](const ToldPlace& p) { return p.has_direction; });
    };
    find_next();
    if (next != told.end())
        turn_to(*next);
    for (const LineStation& station : rest)
    {
        for (; next != told.end() && next->s <= station.s; ++next, find_next())
            turn_to(*next);
        directions.push_back((turn * station.direction).normalized());
    }
    return directions;
}

} // namespace

std::vector<Vector3d> directions_as_told(std::span<const LineStation> rest,
                                         std::span<const ToldPlace> told)
{
    std::vector<ToldPlace> nodes;
    for (const ToldPlace& place : told)
        if (place.has_place && (nodes.empty() || place.s > nodes.back().s))
            nodes.push_back(place);
    if (nodes.size() < 2)
        return directions_alone(rest, told);
    std::vector<Vector3d> at_nodes;
    for (const ToldPlace& node : nodes)
        at_nodes.push_back(station_at(rest, node.s).direction);
    const Eigen::MatrixX3d slopes = slopes_of(nodes, at_nodes);
    const auto slope = [&](std::size_t k) -> Vector3d
    { return slopes.row(static_cast<Eigen::Index>(k)).transpose(); };
    constexpr double kStill = 1e-9; // of the rest's speed
    std::vector<Vector3d> directions;
    std::size_t k = 0;
    for (const LineStation& station : rest)
    {
        while (k + 2 < nodes.size() && station.s >= nodes[k + 1].s)
            ++k;
        const double h = nodes[k + 1].s - nodes[k].s;
        const double u = std::clamp((station.s - nodes[k].s) / h, 0.0, 1.0);
        const Vector3d shift =
            6.0 * u * (1.0 - u) / h * (nodes[k + 1].shift - nodes[k].shift) +
            (1.0 - u) * (1.0 - 3.0 * u) * slope(k) + u * (3.0 * u - 2.0) * slope(k + 1);
        const Vector3d direction = station.direction + shift;
        const double length = direction.norm();
        // A direction whose speed vanishes is that of the place before.
        directions.push_back(length > kStill      ? Vector3d(direction / length)
                             : directions.empty() ? station.direction
                                                  : directions.back());
    }
    return directions;
}

namespace
{

/// The frame of a line: its direction, and a vector carried along it, which is made
/// orthogonal to the direction.
Matrix3d frame_of(const Vector3d& direction, Vector3d& across)
{
    across = (across - direction.dot(across) * direction).normalized();
    Matrix3d frame;
    frame << across, direction.cross(across), direction;
    return frame;
}

} // namespace

CarriedLine carried_along(std::span<const LineStation> rest,
                          std::span<const Vector3d> directions, std::size_t anchor,
                          const Matrix3d& first)
{
    // Two vectors without twist, one carried along each line from the anchor.
    CarriedLine line;
    line.turns.resize(rest.size());
    line.turns[anchor] = first;
    const Vector3d begin = any_across(rest[anchor].direction);
    const auto carry =
        [&](std::size_t from, std::size_t to, Vector3d& at_rest, Vector3d& now)
    {
        const Vector3d rest_side = rest[from].direction.cross(at_rest),
                       side = directions[from].cross(now);
        line.turns_back |= are_opposite(directions[from], directions[to]);
        at_rest =
            shortest_turn(rest[from].direction, rest[to].direction, rest_side) * at_rest;
        now = shortest_turn(directions[from], directions[to], side) * now;
        const Matrix3d before = frame_of(rest[to].direction, at_rest);
        line.turns[to] = frame_of(directions[to], now) * before.transpose();
    };
    Vector3d at_rest = begin, now = first * begin;
    for (std::size_t k = anchor; k + 1 < rest.size(); ++k)
        carry(k, k + 1, at_rest, now);
    at_rest = begin;
    now = first * begin;
    for (std::size_t k = anchor; k > 0; --k)
        carry(k, k - 1, at_rest, now);
    return line;
}

} // namespace cellwarp::core
