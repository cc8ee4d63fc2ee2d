// SPDX-License-Identifier: GPL-3.0-or-later
// Closed surfaces that stand for a shape whose own may be open, in parts, or too fine.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "octree/shape.h"

namespace cellwarp::core
{

/// Ways to a closed surface of \p shape, the most faithful first; each may fail, which
/// the caller sees when it uses the surface. Where \p shape has at most \p most_triangles
/// these are its own triangles, and these with lids over its small openings. Then wraps
/// follow, with ever larger balls: around the triangles with such lids, or around the
/// samples alone where most edges are open or there are none. Keeps a reference to
/// \p shape. \pre some samples
std::vector<std::function<Shape()>> closed_surfaces(const Shape& shape,
                                                    std::size_t most_triangles);

} // namespace cellwarp::core
