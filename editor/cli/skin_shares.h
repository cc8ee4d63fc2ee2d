// SPDX-License-Identifier: GPL-3.0-or-later
// Shares of a skeleton's joints in the samples of a model, by distance.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "io/scene/skinned_file.h"

namespace cellwarp::core
{

/// The joint whose bones are nearest has a sample, and shares it with the joint before
/// and those behind it where their bones are less than twice as far away. One a sample.
/// \pre parents stand before their children; some joint has a bone
std::vector<SkinShares> skin_shares(const std::vector<Eigen::Vector3d>& samples,
                                    const std::vector<SkeletonJoint>& joints);

} // namespace cellwarp::core
