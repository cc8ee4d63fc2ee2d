// SPDX-License-Identifier: GPL-3.0-or-later
// The frames of a rod where it is held. An end that is told a direction has the frame of
// the rod's other end carried there along the line through what is held, without twist;
// an end of which no direction was told keeps the frame of rest.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "library/session/line_bending.h"
#include "library/session/spline_handle.h"

namespace cellwarp::core
{

/// The point whose frame is carried along a rod: the first one that is held as at rest,
/// else the first.
std::size_t frame_anchor(const SplineHandle& rod, const SplineHolds& holds);

/// A rod as its holds have it.
struct HeldLine
{
    SplineHolds holds; ///< with the turns that carry the frames, SplineHold::carried
    /// The rotation of each station's frame from rest, with the twist that is held.
    std::vector<Eigen::Matrix3d> turns;
    /// A direction is told beyond a place where the line turns exactly back: about which
    /// axis is not told.
    bool turns_back = false;
};

HeldLine held_line(const SplineHandle& rod, SplineHolds holds);

/// How far the frames of the points turn from one state of holds to another, at the most
/// [rad].
double turn_between(const SplineHandle& rod, const SplineHolds& from,
                    const SplineHolds& to);

/// The way from where a rod or curve is to what holds it then.
class HoldWay
{
public:
    /// \p from: what holds it at \p now, with places and turns of all points. \p to: with
    /// their frames, see HeldLine. The rod must outlive it.
    HoldWay(const SplineHandle& rod, const SplineState& now, SplineHolds from,
            SplineHolds to);

    /// At \p t in [0, 1]; exactly what it goes to at 1. Frames are those of the line that
    /// bends evenly, see LineBending, and places go along it: where they went straight,
    /// the line between them would be squeezed. A frame that stays is held still, unless
    /// the line winds by half a turn and more in between.
    SplineHolds at(double t) const;

private:
    std::vector<Eigen::Vector3d> bent_places(double t) const;

    const SplineHandle* rod_;
    SplineHolds from_, to_;
    std::vector<std::size_t> stations_;  ///< of the points
    std::optional<LineBending> bending_; ///< nothing: no frame is held
    std::vector<Eigen::Vector3d> begin_,
        end_;                 ///< bent_places(); empty: places go straight
    std::vector<char> stays_; ///< a point's frame
};

} // namespace cellwarp::core
