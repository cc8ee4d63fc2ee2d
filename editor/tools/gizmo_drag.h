// SPDX-License-Identifier: GPL-3.0-or-later
// From the pointer's way over the screen to a motion in space: along an axis, in a plane,
// about an axis. In view space, whose axes are the model's.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "editor/document/document.h"
#include "editor/tools/camera.h"

namespace cellwarp::core
{

/// What the pointer's motion is turned into.
struct DragWay
{
    enum class Kind
    {
        MoveScreen, ///< in the plane that faces the viewer
        MoveAxis,
        MovePlane, ///< the axis stands on it
        TurnView,  ///< about the viewer's line of sight
        TurnAxis,
        TurnFree ///< about the axis at right angles to the pointer's way
    };
    Kind kind = Kind::MoveScreen;
    int axis = 0; ///< 0, 1, 2

    bool turns() const { return kind >= Kind::TurnView; }
    bool operator==(const DragWay&) const = default;
};

/// A shift, or a turn about a region's centre.
struct DragAmount
{
    Eigen::Vector3d shift = Eigen::Vector3d::Zero(); ///< [view]
    Eigen::Vector3d axis = Eigen::Vector3d::UnitX(); ///< unit
    double degrees = 0.0;
};

/// What takes the place of, or rounds, the pointer's amount.
struct DragEntry
{
    /// Lengths are rounded to multiples of it, and angles to those of 5 degrees; 0: not
    /// at all [view].
    double snap = 0.0;
    /// Along the axis (of planes and the screen: along the first of theirs) [view], or
    /// the angle [degree].
    std::optional<double> typed;
};

/// A drag under way. The view stays as it was when it began.
class GizmoDrag
{
public:
    /// Takes hold of what is at \p centre, the pointer being at \p pixel.
    GizmoDrag(const Camera& camera, const Eigen::Vector3d& centre, const DragWay& way,
              const Eigen::Vector2d& pixel);

    const DragWay& way() const { return way_; }
    /// Where the pointer is now. Angles are counted on from place to place, over any
    /// number of turns. What has no meaning (beyond the horizon) changes nothing.
    void move_to(const Eigen::Vector2d& pixel);
    DragAmount amount(const DragEntry& entry = {}) const;

private:
    std::optional<double> along_axis(const Eigen::Vector2d& pixel) const;
    std::optional<Eigen::Vector3d> in_plane(const Eigen::Vector2d& pixel,
                                            const Eigen::Vector3d& normal) const;
    std::optional<double> angle(const Eigen::Vector2d& pixel) const;
    Eigen::Vector3d turn_axis() const;

    Camera camera_;
    Eigen::Vector3d centre_;
    DragWay way_;
    Eigen::Vector2d start_, pixel_;
    Eigen::Vector3d sight_; ///< from the eye to the centre, unit
    bool is_degenerate_;    ///< the axis is seen end-on, the plane edge-on
    Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
    double last_angle_ = 0.0, turned_ = 0.0; ///< [rad]
};

/// A region that was at \p start, shifted and turned about its current centre.
/// \p shift: [model unit]. Turns about one axis add up, however many; those about
/// different ones become one turn of at most 180 degrees.
RigidMove moved(const RigidMove& start, const Eigen::Vector3d& shift,
                const Eigen::Vector3d& axis, double degrees);

} // namespace cellwarp::core
