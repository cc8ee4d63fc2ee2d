// SPDX-License-Identifier: GPL-3.0-or-later
// A person of capsules who stands, symmetric about x = 0, for tests of skeletons.
#pragma once

#include "octree/shape.h"

namespace cellwarp::core::support
{

struct Person
{
    Shape shape; ///< closed; the feet at y = 0, looking along z, about 1.75 high
    /// Joints of the right side of the body (x < 0); the left ones are mirrored.
    Eigen::Vector3d shoulder, elbow, hand, hip, knee, ankle, toe;
    Eigen::Vector3d pelvis, chest, head, mouth; ///< in the plane
};

/// \p arms: how far the arms point down [degree]; 0: T-pose. \p seed: proportions.
Person person(double arms, unsigned seed);

} // namespace cellwarp::core::support
