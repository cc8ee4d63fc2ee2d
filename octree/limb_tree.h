// SPDX-License-Identifier: GPL-3.0-or-later
// Joints for a shape that has none: where its limbs branch, bend and end.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "octree/material.h"

namespace cellwarp::core
{

struct LimbJoint
{
    Eigen::Vector3d at;
    int parent = -1;     ///< before it; -1: the root
    int limb = 0;        ///< from 1, one a branch or a pair of them; 0: the root
    double radius = 0.0; ///< of the shape around it
    /// 1 or -1 on either side of the mirror plane of a symmetric shape; 0 in the plane,
    /// and of a limb that has no counterpart.
    int side = 0;
};

struct LimbOptions
{
    /// A limb bends where its line leaves its bones by more than this share of its
    /// radius.
    double bend = 0.35;
    /// Bones that a straight piece of a limb is divided into if it is longer than
    /// kLongBone of its radii.
    int bones = 2;
};

/// A straight piece of a limb that is longer than this gets several bones [radii].
inline constexpr double kLongBone = 6.0;

/// Joints along the centre lines of \p shape, parents first; the root is the branching
/// that is nearest to the middle of all lines, or an end where nothing branches. Of a
/// ring one place is open. Of a shape that is its own mirror image limbs of both sides
/// are as well, to rounding. Empty where there is no centre line.
std::vector<LimbJoint> limb_tree(const Shape& shape, const LimbOptions& options = {});

} // namespace cellwarp::core
