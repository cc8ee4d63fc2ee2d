// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/default_plane.h"

#include <algorithm>

#include "io/base/error.h"
#include "library/session/flat.h"

namespace cellwarp::core
{

namespace
{

/// Half of what plan_frame() lets a region leave the plane by: what keeps the plane about
/// one place then keeps it about all.
constexpr double kSurelyKept = 0.5 * kKept;

/// No rods, curves and joints.
bool has_regions_alone(const Stage& stage)
{
    return stage.joints.empty() &&
           std::none_of(stage.regions.begin(), stage.regions.end(),
                        [](const RegionStatement& region)
                        { return region.spline != nullptr; });
}

} // namespace

std::optional<DefaultPlane> DefaultPlane::of(const std::vector<Eigen::Vector3d>& samples,
                                             const CellSettings& settings)
{
    const std::optional<Eigen::Vector3d> normal = spanned_plane(samples);
    if (!normal)
        return std::nullopt;
    const WorkFrame frame = frame_of(samples, normal, settings);
    const std::optional<int> axis = axis_across(frame, *normal);
    if (!axis)
        return std::nullopt;
    return DefaultPlane(frame, bounding_box(samples), Eigen::Vector3d::Unit(*axis),
                        frame.to_work(samples.front()),
                        !settings.frame && !frame.axes.isIdentity(0.0));
}

/// On the way of each move from rest.
std::vector<Motion> DefaultPlane::motions(const FrameStatement& frame,
                                          bool is_relative) const
{
    const Units units{frame_, is_relative, box_};
    std::vector<Motion> motions;
    std::vector<std::string> warnings; // they come with the frame
    for (const Move& move : frame.moves)
    {
        // The middle and the border of a region, about which it may turn, are in the
        // plane.
        const HandleTrajectory path(
            {}, steps_of(move, units, {place_, place_, place_}, "", warnings));
        for (const double t : {0.25, 0.5, 1.0})
            motions.push_back(path.at(t));
    }
    return motions;
}

bool DefaultPlane::keeps(const FrameStatement& frame, bool is_relative) const
{
    const std::vector<Motion> all = motions(frame, is_relative);
    return std::all_of(
        all.begin(), all.end(),
        [&](const Motion& motion)
        { return keeps_plane(motion, normal_, place_, frame_.diagonal(), kSurelyKept); });
}

/// Whether the first frame that moves something keeps the plane; nothing: none moves.
std::optional<bool> DefaultPlane::keeps_first(std::span<const FrameStatement> frames,
                                              bool is_relative) const
{
    const auto moves = [](const Motion& motion)
    { return !motion.R.isIdentity(0.0) || !motion.t.isZero(0.0); };
    for (const FrameStatement& frame : frames)
    {
        const std::vector<Motion> all = motions(frame, is_relative);
        if (std::any_of(all.begin(), all.end(), moves))
            return keeps(frame, is_relative);
    }
    return std::nullopt;
}

bool DefaultPlane::keeps(const Stage& stage, bool is_relative) const
try
{
    return has_regions_alone(stage) &&
           keeps_first(stage.frames, is_relative).value_or(false);
}
catch (const Error&)
{
    return false; // the frame is wrong, and says so where it is planned
}

bool DefaultPlane::is_left(const Stage& stage, std::span<const FrameStatement> more,
                           bool is_relative) const
try
{
    if (!has_regions_alone(stage))
        return false;
    std::optional<bool> is_kept = keeps_first(stage.frames, is_relative);
    if (!is_kept)
        is_kept = keeps_first(more, is_relative);
    return is_kept.value_or(false) && !std::all_of(more.begin(), more.end(),
                                                   [&](const FrameStatement& frame)
                                                   { return keeps(frame, is_relative); });
}
catch (const Error&)
{
    return false;
}

} // namespace cellwarp::core
