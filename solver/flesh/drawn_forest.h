// SPDX-License-Identifier: GPL-3.0-or-later
// Drawn hexahedra, each of them the root of an octree: cells are halved along their own
// axes, and keep the trilinear map of the hexahedron that they are a part of.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "octree/octree.h"
#include "solver/flesh/drawn_cells.h"
#include "solver/flesh/lattice.h"

namespace cellwarp::core
{

struct ForestLattice
{
    Lattice lattice;                     ///< of one material
    std::vector<NodeShares> of_vertices; ///< of each node, of the drawn ones
};

/// All trees are one octree, in which no hexahedron touches another: which nodes they
/// share follows from their vertices. So neighbours in one hexahedron differ by one level
/// at the most, and those in two by any number.
class DrawnForest
{
public:
    /// \p max_depth: of halving; less where the octree has no room for it.
    DrawnForest(Hexahedra drawn, int max_depth);

    const Hexahedra& drawn() const { return drawn_; }
    int max_depth() const { return shape_.max_depth; }
    /// The undivided hexahedra, in their order.
    Octree roots() const { return Octree(shape_, has_material()); }
    MaterialTest has_material() const;
    /// The hexahedron that a box is of.
    std::size_t root_of(const Leaf& leaf) const { return idx(leaf.corner.x() / gap()); }

    /// A place in a cell, in [0, 1] along each axis if it is inside.
    struct Place
    {
        std::size_t cell = 0;
        Eigen::Vector3d local = Eigen::Vector3d::Zero();
    };
    /// The leaf at a place of a hexahedron, or the nearest one in it.
    Place place_in_leaf(const Octree& octree, const Place& of_root) const;

    /// The leaves are its cells. Nodes on a side of a larger cell hang, whichever
    /// hexahedron that is a part of. Throws InvertedHexahedron.
    ForestLattice lattice(const Octree& octree) const;

private:
    struct Level;
    Level level_of(const Octree& octree) const;
    std::vector<CellSide> sides(const Octree& octree, const Lattice& lattice) const;
    int gap() const { return 2 * shape_.leaves_per_coarsest(); }
    LatticeBox box_of(std::size_t root) const;
    /// Shares of the vertices at a place of the octree's grid.
    NodeShares shares_at(std::size_t root, const Eigen::Vector3d& place) const;
    /// The leaves that touch a point with these shares of the vertices, and where.
    std::vector<Place> touching(const Octree& octree, const NodeShares& point) const;

    Hexahedra drawn_;
    std::vector<std::vector<std::size_t>> roots_of_vertex_;
    GridShape shape_;
};

} // namespace cellwarp::core
