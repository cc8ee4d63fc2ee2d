// SPDX-License-Identifier: GPL-3.0-or-later
// Joints for a shape that has none: where its limbs branch, bend and end.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "octree/material.h"

namespace cellwarp
{

struct LimbJoint
{
    Eigen::Vector3d at;
    int parent = -1;     ///< before it; -1: the root
    int limb = 0;        ///< from 1, one a branch; 0: the root
    double radius = 0.0; ///< of the shape around it
};

struct LimbOptions
{
    /// A limb bends where its line leaves its bones by more than this share of its
    /// radius.
    double bend = 0.35;
    /// Least bones of a limb that is longer than kLongLimb of its radii.
    int bones = 2;
};

/// How long a limb is that gets several bones, in radii.
inline constexpr double kLongLimb = 6.0;

/// Joints along the centre lines of \p shape, parents first; the root is the branching
/// that is nearest to the middle of all lines, or an end where nothing branches. Of a
/// ring one place is open. Empty where there is no centre line.
std::vector<LimbJoint> limb_tree(const Shape& shape, const LimbOptions& options = {});

} // namespace cellwarp
