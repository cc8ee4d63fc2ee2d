// SPDX-License-Identifier: GPL-3.0-or-later
// Shapes whose material comes close to itself, for tests of what follows the glue.
#pragma once

#include <Eigen/Core>

#include "octree/shape.h"

namespace cellwarp::core::support
{

/// Two bars at a right angle, 4 x 2 x 1: the one along x up to y = \p width, the one
/// along y up to x = 1 + \p width.
Shape angle(double width = 1.0);

/// The hand of the samples: fingers one percent of the diagonal apart.
Shape hand();

/// Mirror images and quarter turns, moved to the origin.
Shape turned(Shape shape, const Eigen::Matrix3d& Q);

} // namespace cellwarp::core::support
