// SPDX-License-Identifier: GPL-3.0-or-later
// The bones of a skeleton as regions: a tube about each, and what of the material they
// leave alone.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "library/session/body.h"
#include "library/session/regions.h"
#include "library/session/skeleton_handle.h"

namespace cellwarp::core
{

/// How the bones of one joint lie in the material.
struct BoneBinding
{
    std::string name;
    double radius = 0.0; ///< of the tube [work]
    double inside = 0.0; ///< share of the bones' length that lies in the material
    int cells = 0;       ///< that move with it
};

struct SkeletonBinding
{
    std::size_t joints = 0;
    std::vector<BoneBinding> bones;
    std::vector<std::string> outside; ///< joints whose bones meet no material
    /// Share of the material that lies farther from every bone than three times as far as
    /// the outside is from the bone, and its place that is farthest [model unit].
    double far_share = 0.0;
    Eigen::Vector3d farthest = Eigen::Vector3d::Zero();
};

/// One region a joint that has bones in the material. Fills all of \p binding but cells.
std::vector<Region> bone_regions(const SkeletonHandle& skeleton, const RestShape& rest,
                                 SkeletonBinding& binding);

/// What the user may not expect of a binding: bones outside, material far from all.
std::vector<std::string> binding_warnings(const SkeletonBinding& binding,
                                          const std::string& file);

} // namespace cellwarp::core
