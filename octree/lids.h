// SPDX-License-Identifier: GPL-3.0-or-later
// Lids over the openings of a mesh, whatever their width.
#pragma once

#include "octree/shape.h"

namespace cellwarp
{

/// The shape with a fan over each loop of open edges: from a sample of its own, the
/// middle of the loop, which comes after all others. Loops that share a corner share it.
/// Of a mesh whose triangles are oriented alike it is closed.
Shape with_lids(const Shape& shape);

} // namespace cellwarp
