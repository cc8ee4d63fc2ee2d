// SPDX-License-Identifier: GPL-3.0-or-later
// What of a shape's triangles may bound an inside.
#pragma once

#include <vector>

#include "octree/shape.h"

namespace cellwarp::core
{

struct BoundingSurface
{
    /// Coincident corners joined, degenerate ones and repeated copies dropped; ascending.
    std::vector<Triangle> triangles;
    /// The share of edges that lack their opposite; 0: closed and oriented, 1: no
    /// triangle.
    double open_edges = 1.0;
};

BoundingSurface bounding_surface(const Shape& shape);

} // namespace cellwarp::core
