// SPDX-License-Identifier: GPL-3.0-or-later
// The limbs of a model: where they branch, bend and end.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "io/formats/geometry.h"
#include "octree/limb_tree.h"

namespace cellwarp::core
{

/// limb_tree() of a model, two joints at the least. \p path names it. Throws
/// Fault::Unsolvable where the shape has no centre line, Fault::File where the library
/// that finds it fails.
std::vector<LimbJoint> limbs_of(const std::string& path, const Geometry& geometry,
                                const LimbOptions& options = {});

/// Where a limb ends.
struct LimbEnd
{
    std::size_t num_samples = 0; ///< nearer to it than to any other joint
    Eigen::AlignedBox3d box;     ///< of these, in the model's box (0 to 1), outwards to
                                 ///< whole hundredths
};

/// The ends of limbs that have samples, a quarter of all at the most, in the order of
/// their joints. \pre some joints
std::vector<LimbEnd> limb_ends(const std::vector<LimbJoint>& joints,
                               const Geometry& geometry);

} // namespace cellwarp::core
