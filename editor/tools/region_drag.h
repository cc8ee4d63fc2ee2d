// SPDX-License-Identifier: GPL-3.0-or-later
// A region in the hand: the pointer, the axis keys and typed numbers become a place for
// it, and words for the status line.
#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "editor/document/document.h"
#include "editor/tools/events.h"
#include "editor/tools/gizmo_drag.h"
#include "editor/tools/typed_number.h"

namespace cellwarp::core
{

/// Of a model: what a drag needs to know.
struct DragSpace
{
    double view_per_model = 1.0; ///< [view/model unit]
    double snap = 0.0;           ///< step of lengths [model unit]
};

/// The step of lengths for a model: 1, 2 or 5 times a power of ten, at most a twentieth
/// of its longest side [model unit].
double snap_step(double longest_side);

class RegionDrag
{
public:
    /// \p turned: the region's placement, told as a turn about what it is turned about
    /// from now on, which is at \p centre now [view]. \p grabbed: what the pointer holds,
    /// the centre if none.
    RegionDrag(const EditedRegion& region, const RigidMove& turned,
               const DragSpace& space, const Camera& camera,
               const Eigen::Vector3d& centre,
               const std::optional<Eigen::Vector3d>& grabbed, const DragWay& way,
               const Eigen::Vector2d& pixel);

    const std::string& region() const { return region_; }
    const DragWay& way() const { return drag_.way(); }
    void move_to(const Eigen::Vector2d& pixel, bool snaps);
    /// X, Y and Z, with Shift for planes; digits and what belongs to numbers; Backspace.
    /// R while it turns about the line of sight: freely. False: the key means nothing
    /// here.
    bool key(const KeyEvent& event);

    RigidMove placement() const;
    Eigen::Vector3d centre() const; ///< now [view]
    bool is_typed() const { return !typed_.empty(); }
    /// "Move X 0.23".
    std::string status() const;

private:
    void change_way(const DragWay& way);
    DragAmount amount() const;

    std::string region_;
    bool can_turn_;
    RigidMove start_, turned_;
    DragSpace space_;
    Camera camera_;
    Eigen::Vector3d centre_, grabbed_; ///< where it began [view]
    Eigen::Vector2d pressed_, pixel_;
    bool snaps_ = false;
    TypedNumber typed_;
    GizmoDrag drag_;
};

} // namespace cellwarp::core
