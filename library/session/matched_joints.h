// SPDX-License-Identifier: GPL-3.0-or-later
// The joints of two skeletons that correspond to each other. matched_joints.cpp has the
// method.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "io/scene/skeleton_file.h"

namespace cellwarp::core
{

struct MatchedJoints
{
    /// For each joint the one of the other skeleton that it is; -1: none.
    std::vector<int> of_other;
    /// Quarter turns about y after which the other skeleton looks the same way.
    int quarter_turns = 0;
};

/// By names, where at least half of the joints that have bones are named as joints of the
/// other one (but for case, signs and what is before a colon); else by the shape of both
/// trees, at rest. \pre parents stand before their children, y points up
MatchedJoints matched_joints(const std::vector<SkeletonJoint>& joints,
                             const std::vector<SkeletonJoint>& other);

/// The number of each joint's parent, or -1.
std::vector<int> parents_of(const std::vector<SkeletonJoint>& joints);

} // namespace cellwarp::core
