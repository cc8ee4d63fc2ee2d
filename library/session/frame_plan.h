// SPDX-License-Identifier: GPL-3.0-or-later
// Where one frame takes the regions.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/scene/handle_file.h"
#include "library/session/body.h"
#include "library/session/handle_trajectory.h"
#include "library/session/region_set.h"
#include "library/session/skeleton_handle.h"

namespace cellwarp::core
{

/// Where the statements so far have a region.
struct RegionAim
{
    std::vector<MoveStep> steps;
    SplineHolds holds;        ///< of a rod or curve; empty: as at rest
    bool is_on_guide = false; ///< a pin on a curve has come there
    /// Of a rod that is led: where it is; null: at rest.
    std::shared_ptr<const SplineState> led = {};
};

/// Where the statements so far have all regions, and the skeleton if there is one.
struct StageAims
{
    std::vector<RegionAim> regions;
    SkeletonAim skeleton;
};

struct FramePlan
{
    std::vector<HandleTrajectory> paths; ///< a region
    /// Of rods and curves, a region; empty for others.
    std::vector<SplineHolds> from_holds, to_holds;
    /// Of rods that are led, a region: where they go; null for others, and if they stay.
    std::vector<std::shared_ptr<const SplineState>> led;
    /// Of bones, by their skeleton; null: there is none.
    std::shared_ptr<const SkeletonHandle> skeleton;
    SkeletonAim from_pose, to_pose;
    std::vector<int> joint_of_region; ///< -1: no bone
    /// Regions that turn by half a turn, of which nothing says which way round, those
    /// together that turn alike.
    std::vector<std::vector<std::size_t>> half_turns;
    int num_parts = 1; ///< in which the way is gone

    /// Whether no region moves.
    bool stands() const;
    /// Whether a region turns by more than half a turn.
    bool is_wound() const;
    /// The same plan, but these regions go the other way round.
    FramePlan reversed(std::span<const std::size_t> regions) const;
    /// Of the regions, at \p t of the way in [0, 1].
    std::vector<Motion> motions(double t) const;
};

/// Whether a move, not of a joint, is about points of a rod or curve, not about a region
/// as a whole: a release of a rod as a whole is about both of its ends.
bool is_of_points(const Move& move);

/// A joint that is nearer to its place has reached it [diagonal].
inline constexpr double kReachedPlace = 1e-6;

/// Adds warnings of turns that limits cut in \p frame, and of places out of reach.
/// \p aim: where the frame has the skeleton.
void warn_of_joints(const SkeletonHandle& skeleton, const SkeletonAim& aim,
                    const FrameStatement& frame, const std::string& file, double diagonal,
                    std::vector<std::string>& warnings);

/// What a move or a release of a point makes of what holds a rod or curve, in
/// frame \p frame. Throws Fault::Malformed.
void hold_point(const Move& move, const SplineHandle& spline, const Units& units,
                const std::string& file, std::int64_t frame, SplineHolds& holds);

/// At rest.
StageAims rest_aims(const RegionSet& regions);

/// The way from where \p aims have the regions; they are those of the frame afterwards.
/// \p borders: of the regions, where 'about border' turns [work]. \p led: of the rods
/// that are led, in their order; empty: they stay. \p file names the handle file. Throws
/// Fault::Malformed.
FramePlan plan_frame(const FrameStatement& frame, const RegionSet& regions,
                     std::span<const Eigen::Vector3d> borders, const Units& units,
                     const RestShape& rest, const std::string& file,
                     std::span<const std::shared_ptr<const SplineState>> led,
                     StageAims& aims, std::vector<std::string>& warnings);

} // namespace cellwarp::core
