// SPDX-License-Identifier: GPL-3.0-or-later
// Tetrahedra that fill a closed surface, made by CGAL: nothing of them comes from the
// voxels and cells of the program that they are there to be compared with.
#pragma once

#include <functional>

#include "octree/material.h"
#include "tests/bench/tet_mesh.h"

namespace cellwarp::core::bench
{

/// How long the edges of tetrahedra are to be about a place.
using EdgeLength = std::function<double(const Eigen::Vector3d&)>;

/// Fills \p surface with tetrahedra. Its own edges stay where its faces meet at more than
/// \p sharp [degree]. Of two runs one may have a thousandth more tetrahedra: the mesher
/// goes by the order of addresses. Throws Fault::Malformed where the surface is not
/// closed.
TetMesh fill_with_tets(const Shape& surface, const EdgeLength& edge, double sharp);

} // namespace cellwarp::core::bench
