// SPDX-License-Identifier: GPL-3.0-or-later
// The regions of a stage as panels and tools see them, found from its statements.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "io/scene/handle_file.h"
#include "library/session/handle_trajectory.h"
#include "library/session/skeleton_handle.h"
#include "library/session/spline_handle.h"
#include "octree/base/rigid_move.h"
#include "octree/coincident_samples.h"

namespace cellwarp::core
{

/// A point of a rod or curve as it is written, and what is said of it at the current
/// edit.
struct EditedPoint
{
    Eigen::Vector3d rest = Eigen::Vector3d::Zero();  ///< [model unit]
    Eigen::Vector3d place = Eigen::Vector3d::Zero(); ///< where it is held, if it is
    Eigen::Vector3d tangent = Eigen::Vector3d::Zero();
    double degrees = 0.0; ///< turn about the tangent
    HoldParts parts;
    bool is_told = false;  ///< the tangent; else it is that of rest
    bool has_frame = true; ///< false: a control point off the line

    bool operator==(const EditedPoint&) const = default;
};

/// How a point of a rod or curve is moved: in rest coordinates, before the motion of the
/// whole.
struct PointPlacement
{
    std::optional<Eigen::Vector3d> place; ///< [model unit]
    std::optional<double> degrees;        ///< about the tangent, from rest

    bool operator==(const PointPlacement&) const = default;
};

/// A new rod or curve through points.
struct RodShape
{
    std::vector<Eigen::Vector3d> points; ///< [model unit]
    bool is_closed = false;
    std::optional<double> radius = {}; ///< of the tube that it carries [model unit]
    std::optional<double> stiffness =
        {}; ///< with which a rod pushes back; none: it leads
};

/// How much stiffer a stiff region is that says nothing else.
inline constexpr double kUsualStiffness = 10.0;

/// A region of the current stage as panels and tools see it.
struct EditedRegion
{
    std::string name;
    Role role = Role::Fixed;
    double factor = 1.0;                              ///< of a stiff region
    std::vector<std::uint32_t> samples;               ///< ascending
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(); ///< Region::centre [model unit]
    /// From rest to the current edit: its axis is unit, without a pivot it turns about
    /// the centre [model unit].
    RigidMove placement;
    /// Where its glue to free material is at rest, where the cells are known [model
    /// unit].
    std::optional<Eigen::Vector3d> border = {};
    /// False where they follow from a rest shape that is not known yet: then they are
    /// those that the model would have.
    bool knows_samples = true, knows_placement = true;

    /// Of a rod or curve.
    std::shared_ptr<const SplineHandle> spline = {};
    std::shared_ptr<const SplineStatement> line = {}; ///< as it is written
    std::vector<EditedPoint> points = {};

    std::string guide = {};           ///< of a pin that stays on a curve or rod: which
    std::optional<double> share = {}; ///< where on it; none: it slides
    WorkFrame frame = {};             ///< of the ground that it was found on

    /// Of a joint: what is above it. Its placement is the motion that space around it
    /// makes, from rest.
    struct JointPart
    {
        bool is_root = false, is_held = false; ///< held: at a place that others turn for
        Eigen::Matrix3d turn_above = Eigen::Matrix3d::Identity(); ///< in model axes
    };
    std::optional<JointPart> joint = {};
    /// A place of a rod or curve at rest [model unit].
    Eigen::Vector3d rest_at(double s) const
    {
        return frame.to_model(spline->rest()->at(s).place);
    }
    /// What its placement turns about, at rest [model unit].
    Eigen::Vector3d pivot() const { return placement.pivot.value_or(centre); }
    bool is_guided() const { return !guide.empty(); }
    bool is_spline() const { return role == Role::Rod || role == Role::Curve; }
    bool moves() const
    {
        return role == Role::Handle || (role == Role::Pin && !is_guided()) ||
               is_spline() || joint.has_value();
    }
};

/// What a stage's statements are read on.
struct RegionGround
{
    const Geometry& geometry;
    const std::vector<Eigen::Vector3d>& rest; ///< samples [model unit]
    Units units;
    const HandleFile& file;              ///< of the statements
    const CoincidentSamples& coincident; ///< of the samples
    bool is_known = true; ///< false: the model stands for a rest that is not there yet
};

/// Of all statements, at rest. Throws what resolve_regions() throws.
std::vector<EditedRegion> edited_regions(const std::vector<RegionStatement>& statements,
                                         const RegionGround& ground);

/// Of all joints, where \p aim has them.
std::vector<EditedRegion> edited_joints(const SkeletonHandle& skeleton,
                                        const SkeletonAim& aim,
                                        const RegionGround& ground);

/// What takes a joint to a placement: a turn of itself, or of those above it so that it
/// comes to its place.
Move joint_move(const EditedRegion& joint, const RigidMove& to,
                const RegionGround& ground);

/// A list of samples as a selector.
Selector selector_of(const std::vector<std::uint32_t>& samples);

/// Where a move puts a region; one that turns about its border: where that is known, else
/// about its centre. Throws what steps_of() throws.
RigidMove placement_of(const Move& move, const EditedRegion& region,
                       const RegionGround& ground);
/// Whether that is the same on any rest shape.
bool is_placed_anywhere(const Move& move, const RegionGround& ground);
/// Whether it turns where the region's glue is, which the cells alone tell.
bool turns_about_border(const Move& move);

/// What the moves of its points, of the frames so far, make of a rod or curve.
std::vector<EditedPoint> points_of(const EditedRegion& region,
                                   const std::vector<FrameStatement>& frames,
                                   const RegionGround& ground);

/// The same as a session has them, whose rod or curve is \p spline.
SplineHolds holds_of(const EditedRegion& region, const SplineHandle& spline,
                     const WorkFrame& frame);

/// What a point is held by after a move.
EditedPoint moved(EditedPoint point, const PointPlacement& to);

/// The frame that moves a point so, or lets it go.
FrameStatement frame_of_point(const EditedRegion& region, std::size_t point,
                              const PointPlacement& to, std::int64_t number,
                              const RegionGround& ground);
FrameStatement frame_of_release(const EditedRegion& region, std::size_t point,
                                const HoldParts& parts, std::int64_t number);

/// As it is written, in the model's unit.
RodShape shape_of(const EditedRegion& region);

/// What a rod or curve is written as; curves have no radius. \p like: what it was, with
/// all that is not told.
SplineStatement line_of(const RodShape& shape, Role role, const RegionGround& ground,
                        SplineStatement like = {});

/// Where in rest coordinates, before the motion of the whole, a place of a rod is
/// [model].
Eigen::Vector3d before_motion(const EditedRegion& region, const Eigen::Vector3d& place);

/// A region's placement as a motion of work space.
Motion motion_of(const RigidMove& placement, const Eigen::Vector3d& centre,
                 const WorkFrame& frame);
/// The same of model space.
Motion motion_of(const EditedRegion& region);

/// Whether a file in these units can tell a place: shares of a flat box tell none beside
/// it.
bool can_tell(const Eigen::Vector3d& place, const Units& units);

/// The placement that moves the region alike, told as a turn about another place at rest
/// [model unit].
RigidMove about(const Eigen::Vector3d& pivot, const EditedRegion& region);

/// Whether a placement, whatever it turns about, is where the region is.
bool is_at(const EditedRegion& region, const RigidMove& placement);

/// The frames that take a region to a placement, numbers from \p number on: one, or two
/// where the way would not be clear from its end alone (more than half a turn about a new
/// axis, a turn goes on about another pivot).
std::vector<FrameStatement> frames_to(const EditedRegion& region, const RigidMove& to,
                                      std::int64_t number, const RegionGround& ground);

} // namespace cellwarp::core
