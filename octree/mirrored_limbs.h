// SPDX-License-Identifier: GPL-3.0-or-later
// Makes the limbs of a symmetric shape symmetric.
#pragma once

#include <functional>
#include <vector>

#include "octree/limb_tree.h"
#include "octree/mirror_plane.h"

namespace cellwarp::core
{

/// The tree with its middle joints in \p plane, and of each limb beside them one and its
/// mirror image, with the same number and LimbJoint::side 1 on the side of the normal, -1
/// on the other. Empty where the tree does not lie about the plane: its root is beside
/// it, or the image of a limb has no place though there is one on the other side. \p
/// is_inside: whether a joint may be there; a limb without a counterpart stays alone
/// where its image may not. \p tolerance: joints nearer to the plane are in it.
std::vector<LimbJoint>
mirrored_limbs(const std::vector<LimbJoint>& joints, const MirrorPlane& plane,
               double tolerance,
               const std::function<bool(const Eigen::Vector3d&)>& is_inside);

} // namespace cellwarp::core
