// SPDX-License-Identifier: GPL-3.0-or-later
// Springs from places of a rod to places of the world.
#pragma once

#include <memory>
#include <vector>

#include "solver/rods/rod_term.h"

namespace cellwarp
{

struct PointSpring
{
    double s = 0.0; ///< parameter of the curve
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    double stiffness = 0.0; ///< [N/m]
    double length = 0.0;    ///< at rest [m]
};

/// 1/2 stiffness (|P - point| - length)^2 each. The rod must outlive it.
std::unique_ptr<RodTerm> point_springs(const Rod& rod, std::vector<PointSpring> springs);

} // namespace cellwarp
