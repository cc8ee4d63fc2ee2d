// SPDX-License-Identifier: GPL-3.0-or-later
// Lids over the openings of a mesh, whatever their width.
#pragma once

#include <limits>

#include "octree/shape.h"

namespace cellwarp::core
{

/// The shape with a fan over each loop of open edges that is not longer than \p longest:
/// from a sample of its own, the middle of the loop, which comes after all others. Loops
/// that share a corner share it. Without a bound a mesh whose triangles are oriented
/// alike is closed.
Shape with_lids(const Shape& shape,
                double longest = std::numeric_limits<double>::infinity());

} // namespace cellwarp::core
