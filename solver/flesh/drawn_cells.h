// SPDX-License-Identifier: GPL-3.0-or-later
// Lattices that were drawn from hexahedra, tetrahedra and wedges: all as hexahedra.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/box_nodes.h"
#include "solver/flesh/sparse_rows.h"

namespace cellwarp::core
{

struct DrawnCells
{
    std::vector<Eigen::Vector3d> places;
    /// Of 4, 6 or 8 corners: a tetrahedron; a wedge as two triangles; a hexahedron as two
    /// loops of four, one above the other.
    std::vector<std::vector<int>> cells;
    std::vector<std::pair<int, int>> edges; ///< bones
};

/// Hexahedra, and the edges' parts.
struct Hexahedra
{
    std::vector<Eigen::Vector3d> places;
    std::vector<CornerNodes> cells;
    std::vector<int> cell_of; ///< that was drawn
    std::vector<std::pair<int, int>> edges;
    /// The mean that each place is of places of what was split; of a place that was kept
    /// itself.
    std::vector<NodeShares> means;
};

/// If all cells are hexahedra they stay; else all are split once, at the means of edges,
/// faces and cells: affine maps stay exact. [theory-skeleton 1 (c)] Cells are turned the
/// right way round.
Hexahedra hexahedra_of(const DrawnCells& drawn);

} // namespace cellwarp::core
