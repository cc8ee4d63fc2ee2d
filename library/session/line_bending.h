// SPDX-License-Identifier: GPL-3.0-or-later
// How a line bends and twists from one state to another. Its frames are carried along its
// own bend, station by station, never by the shortest turn between two states: so a line
// that is bent by more than half a turn does not wind about itself on the way.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

/// The way of a line between two states. A state is one rotation a station: that of its
/// frame, from rest. Neighbouring stations must differ by less than half a turn.
class LineBending
{
public:
    /// \p from and \p to: of the same stations, at least one, in their order.
    LineBending(std::vector<Eigen::Matrix3d> from, std::vector<Eigen::Matrix3d> to);

    /// The rotations at \p t in [0, 1]; exactly those of the ends at 0 and 1.
    std::vector<Eigen::Matrix3d> at(double t) const;
    /// For each station how far it turns on the way [rad].
    std::vector<double> turns() const;
    /// For each station how far it is away from where it began, at the most [rad].
    std::vector<double> largest_turns() const;

private:
    std::vector<Eigen::Matrix3d> from_, to_;
    std::size_t anchor_ = 0;               ///< the station that turns least
    Eigen::Vector3d anchor_turn_;          ///< of it, by the shortest way
    Eigen::Matrix3Xd from_bend_, to_bend_; ///< between stations: axis times angle
};

/// A place at which something is said of a line.
struct ToldPlace
{
    double s = 0.0; ///< along the line at rest [length]
    bool has_place = false, has_direction = false;
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();     ///< of the place, from rest
    Eigen::Vector3d direction = Eigen::Vector3d::Zero(); ///< of the line, unit
};

/// A line at rest at one station.
struct LineStation
{
    double parameter = 0.0;
    double s = 0.0;                                       ///< along the line [length]
    Eigen::Vector3d direction = Eigen::Vector3d::UnitX(); ///< unit
};

/// The directions, at stations, of the line that passes through what is told: the rest
/// line, shifted by the smoothest curve (of least integral of |shift''|^2) that has the
/// shifts of the places and the directions there, at unit speed. Before the first and
/// behind the last place it goes on straight. With no place in common it has, from each
/// direction that is told on, this direction. [unit]
std::vector<Eigen::Vector3d> directions_as_told(std::span<const LineStation> rest,
                                                std::span<const ToldPlace> told);

/// The rotations that carry the frames of a rest line to another line without twist.
struct CarriedLine
{
    std::vector<Eigen::Matrix3d> turns; ///< a station: of its frame, from rest
    /// Somewhere the line turns exactly back: about which axis is not told.
    bool turns_back = false;
};

/// From the frame that \p first carries at station \p anchor, both ways along the line.
/// \p directions: one a station. \pre first carries the rest direction of the anchor to
/// its new one.
CarriedLine carried_along(std::span<const LineStation> rest,
                          std::span<const Eigen::Vector3d> directions, std::size_t anchor,
                          const Eigen::Matrix3d& first);

/// The shortest turn from one unit vector to another. To the exactly opposite one, to
/// kHalfTurnRounding, it goes about \p across, which must be across \p from.
Eigen::Matrix3d shortest_turn(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                              const Eigen::Vector3d& across);
/// Whether there is no shortest turn.
bool are_opposite(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

} // namespace cellwarp::core
