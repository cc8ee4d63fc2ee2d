// SPDX-License-Identifier: GPL-3.0-or-later
// Inverse kinematics: turns of joints that bring others to places. reach.cpp tells how.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/skeleton/skeleton.h"

namespace cellwarp::core
{

/// A joint that is to come to a place.
struct ReachTarget
{
    int joint = 0;
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    std::vector<int> chain; ///< joints above it that turn for it, in any order
};

struct ReachReport
{
    int iterations = 0;
    std::vector<double> misses; ///< distance of each joint from its place
};

/// The joints that turn for \p joint where nothing else is said: those above it, up to
/// below the next one where the skeleton branches, or to the root.
std::vector<int> usual_chain(const Skeleton& skeleton, int joint);

/// Turns the joints of the chains, within their limits, so that the targets come to their
/// places, all together, or as near as they get (least squares), with little turn from
/// \p pose. A joint at rest whose limits do not hold is brought within them.
ReachReport reach(const Skeleton& skeleton, std::span<const ReachTarget> targets,
                  SkeletonPose& pose);

} // namespace cellwarp::core
