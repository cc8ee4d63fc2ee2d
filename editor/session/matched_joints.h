// SPDX-License-Identifier: GPL-3.0-or-later
// Which joint of one skeleton is which of another. matched_joints.cpp tells how they are
// found.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "io/skeleton_file.h"

namespace cellwarp
{

struct MatchedJoints
{
    /// For each joint the one of the other skeleton that it is; -1: none.
    std::vector<int> of_other;
    /// How far the other skeleton is turned about y to look the same way: so many quarter
    /// turns.
    int quarter_turns = 0;
};

/// By names, where at least half of the joints that have bones are named as joints of the
/// other one (but for case, signs and what is before a colon); else by the shape of both
/// trees, at rest. \pre parents stand before their children, y points up
MatchedJoints matched_joints(const std::vector<SkeletonJoint>& joints,
                             const std::vector<SkeletonJoint>& other);

/// The number of each joint's parent, or -1.
std::vector<int> parents_of(const std::vector<SkeletonJoint>& joints);

} // namespace cellwarp
