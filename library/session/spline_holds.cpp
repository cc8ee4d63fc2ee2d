// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/spline_holds.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The station of each point of the statement.
std::vector<std::size_t> stations_of_points(const SplineHandle& rod)
{
    const std::vector<LineStation>& stations = rod.stations();
    std::vector<std::size_t> found;
    for (std::size_t k = 0; k < rod.num_points(); ++k)
    {
        const double wanted = rod.parameter_of_point(k);
        const auto nearest = std::min_element(
            stations.begin(), stations.end(),
            [wanted](const LineStation& a, const LineStation& b)
            { return std::abs(a.parameter - wanted) < std::abs(b.parameter - wanted); });
        found.push_back(static_cast<std::size_t>(nearest - stations.begin()));
    }
    return found;
}

/// The angle about \p axis by which \p to is turned against \p from. Both carry the same
/// vector to it.
double turn_about(const Vector3d& axis, const Matrix3d& from, const Matrix3d& to)
{
    const Matrix3d turn = to * from.transpose();
    const Vector3d across = axis.unitOrthogonal(), turned = turn * across;
    return std::atan2(axis.dot(across.cross(turned)), across.dot(turned));
}

bool has_frame(const SplineHandle& rod, const SplineHolds& holds, std::size_t k)
{
    return (holds[k].parts.tangent || holds[k].parts.twist) && rod.has_frame_at(k);
}

bool has_frames(const SplineHandle& rod, const SplineHolds& holds)
{
    for (std::size_t k = 0; k < holds.size(); ++k)
        if (has_frame(rod, holds, k))
            return true;
    return false;
}

} // namespace

std::size_t frame_anchor(const SplineHandle& rod, const SplineHolds& holds)
{
    for (std::size_t k = 0; k < holds.size(); ++k)
        if (rod.has_frame_at(k) && holds[k].parts.tangent && holds[k].parts.twist &&
            !holds[k].is_told)
            return k;
    return 0;
}

HeldLine held_line(const SplineHandle& rod, SplineHolds holds)
{
    const std::vector<LineStation>& rest = rod.stations();
    HeldLine line;
    line.turns.assign(rest.size(), Matrix3d::Identity());
    if (!rod.is_rod() || !has_frames(rod, holds))
    {
        line.holds = std::move(holds);
        return line;
    }
    const std::vector<std::size_t> at = stations_of_points(rod);
    const SplineHolds at_rest = rod.rest_holds();
    std::vector<ToldPlace> told;
    for (std::size_t k = 0; k < holds.size(); ++k)
        if (const HoldParts& parts = holds[k].parts; parts.place || parts.tangent)
            told.push_back({rest[at[k]].s, parts.place, parts.tangent,
                            holds[k].place - at_rest[k].place, holds[k].tangent});
    const std::vector<Vector3d> directions = directions_as_told(rest, told);
    const std::size_t anchor = at[frame_anchor(rod, holds)];
    const Vector3d& from = rest[anchor].direction;
    line.turns_back = are_opposite(from, directions[anchor]);
    CarriedLine carried =
        carried_along(rest, directions, anchor,
                      shortest_turn(from, directions[anchor], from.unitOrthogonal()));
    line.turns_back |= carried.turns_back;
    // Stations with a held twist, and its angle.
    std::vector<std::pair<std::size_t, double>> twists;
    bool is_told = false;
    for (std::size_t k = 0; k < holds.size(); ++k)
    {
        SplineHold& hold = holds[k];
        hold.carried.setIdentity();
        if (!has_frame(rod, holds, k))
            continue;
        const Vector3d& direction = directions[at[k]];
        double turn = hold.turn;
        if (hold.parts.tangent)
        {
            line.turns_back |= are_opposite(direction, hold.tangent);
            const Matrix3d here =
                shortest_turn(direction, hold.tangent, direction.unitOrthogonal()) *
                carried.turns[at[k]];
            if (hold.is_told)
                hold.carried = here;
            turn += turn_about(hold.tangent, here, hold.carried);
            is_told |= hold.is_told;
        }
        if (hold.parts.twist)
            twists.emplace_back(at[k], turn);
    }
    line.turns_back = line.turns_back && is_told;
    for (std::size_t j = 0; j < rest.size() && !twists.empty(); ++j)
    {
        const auto next =
            std::find_if(twists.begin(), twists.end(),
                         [j](const auto& twist) { return twist.first >= j; });
        double turn = twists.back().second;
        if (next == twists.begin())
            turn = twists.front().second;
        else if (next != twists.end())
        {
            const auto& [before, turned] = *(next - 1);
            const double share =
                (rest[j].s - rest[before].s) / (rest[next->first].s - rest[before].s);
            turn = turned + share * (next->second - turned);
        }
        carried.turns[j] = rotation_about(directions[j], turn) * carried.turns[j];
    }
    line.turns = std::move(carried.turns);
    line.holds = std::move(holds);
    return line;
}

double turn_between(const SplineHandle& rod, const SplineHolds& from,
                    const SplineHolds& to)
{
    double turn = 0.0;
    if (!rod.is_rod())
        return turn;
    for (std::size_t k = 0; k < to.size(); ++k)
        turn = std::max(turn, std::abs(to[k].turn - from[k].turn));
    const std::vector<double> turns =
        LineBending(held_line(rod, from).turns, held_line(rod, to).turns).turns();
    const std::vector<std::size_t> at = stations_of_points(rod);
    for (std::size_t k = 0; k < to.size(); ++k)
        if (has_frame(rod, to, k))
            turn = std::max(turn, turns[at[k]]);
    return turn;
}

HoldWay::HoldWay(const SplineHandle& rod, const SplineState& now, SplineHolds from,
                 SplineHolds to)
    : rod_(&rod), from_(std::move(from)), to_(std::move(to)),
      stations_(stations_of_points(rod)), stays_(to_.size(), 0)
{
    if (!rod.is_rod() || !has_frames(rod, to_))
        return;
    std::vector<Matrix3d> turns;
    for (const LineStation& station : rod.stations())
        turns.push_back(now.carry(station.parameter).R);
    const HeldLine line = held_line(rod, to_);
    bending_.emplace(std::move(turns), line.turns);
    if (!line.turns_back)
    {
        begin_ = bent_places(0.0);
        end_ = bent_places(1.0);
    }
    constexpr double kSame = 1e-9;
    const std::vector<Matrix3d> begin = bending_->at(0.0), end = bending_->at(1.0);
    const std::vector<double> largest = bending_->largest_turns();
    for (std::size_t k = 0; k < to_.size(); ++k)
    {
        const std::size_t j = stations_[k];
        const bool winds = largest[j] > 0.5 * std::numbers::pi && !line.turns_back;
        stays_[k] = (begin[j] - end[j]).norm() <= kSame && !winds;
    }
}

/// The places of the points, from the first one on, on a line that bends as its frames do
/// and does not stretch.
std::vector<Vector3d> HoldWay::bent_places(double t) const
{
    const std::vector<Matrix3d> turns = bending_->at(t);
    const std::vector<LineStation>& rest = rod_->stations();
    std::vector<Vector3d> line(rest.size(), Vector3d::Zero());
    for (std::size_t j = 1; j < rest.size(); ++j)
        line[j] = line[j - 1] + 0.5 * (rest[j].s - rest[j - 1].s) *
                                    (turns[j - 1] * rest[j - 1].direction +
                                     turns[j] * rest[j].direction);
    std::vector<Vector3d> places;
    for (const std::size_t j : stations_)
        places.push_back(line[j] - line[stations_.front()]);
    return places;
}

SplineHolds HoldWay::at(double t) const
{
    if (t >= 1.0)
        return to_;
    SplineHolds holds = to_;
    const std::vector<Matrix3d> turns =
        bending_ ? bending_->at(t) : std::vector<Matrix3d>();
    const std::vector<LineStation>& rest = rod_->stations();
    const std::vector<Vector3d> bent =
        begin_.empty() ? std::vector<Vector3d>() : bent_places(t);
    for (std::size_t k = 0; k < holds.size(); ++k)
    {
        SplineHold& hold = holds[k];
        hold.place = from_[k].place + t * (to_[k].place - from_[k].place);
        if (!bent.empty())
            hold.place += bent[k] - begin_[k] - t * (end_[k] - begin_[k]);
        hold.turn = from_[k].turn + t * (to_[k].turn - from_[k].turn);
        if (!has_frame(*rod_, holds, k) || !hold.parts.tangent)
            continue;
        if (stays_[k])
        {
            hold.turn = to_[k].turn;
            continue;
        }
        const std::size_t j = stations_[k];
        hold.tangent = (turns[j] * rest[j].direction).normalized();
        hold.carried = rotation_about(hold.tangent, -hold.turn) * turns[j];
    }
    return holds;
}

} // namespace cellwarp::core
