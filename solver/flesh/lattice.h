// SPDX-License-Identifier: GPL-3.0-or-later
// The lattice in which flesh moves: hexahedra with nodes at their corners, between which
// displacements are trilinear. Made of the octree's pieces of material, or drawn by hand.
// [Capell02]
#pragma once

#include <array>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "octree/pieces.h"
#include "octree/voxel_grid.h"
#include "solver/flesh/box_nodes.h"
#include "solver/flesh/sparse_rows.h"

namespace cellwarp::core
{

/// Elastic and of even density.
struct FleshMaterial
{
    double young = 1e4;      ///< [Pa]; > 0
    double poisson = 0.4;    ///< in [0, 0.5)
    double density = 1000.0; ///< [kg/m^3]; > 0

    double shear() const { return young / (2.0 * (1.0 + poisson)); } ///< mu, G [Pa]
    double lambda() const                                            ///< [Pa]
    {
        return 2.0 * shear() * poisson / (1.0 - 2.0 * poisson);
    }
};

/// What of a hexahedron is of one material.
struct LatticePart
{
    int cell = 0;
    int material = 0;
    double volume = 0.0;                              ///< [m^3]
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(); ///< [m]
    /// (1/V) int (x - centre)(x - centre)^T over the part [m^2].
    Eigen::Matrix3d second_moment = Eigen::Matrix3d::Zero();
};

/// Cells that share a side, or a part of it, and how wide they are across it [m].
struct CellSide
{
    int a = 0, b = 0;
    double width_a = 0.0, width_b = 0.0;
};

/// Rest state: immutable once built.
struct Lattice
{
    std::vector<Eigen::Vector3d> places; ///< of the nodes [m]
    std::vector<CornerNodes> cells;      ///< corners as box_nodes.h has them
    /// The cells' boxes in an octree; empty: they are of none.
    std::vector<LatticeBox> boxes;
    std::vector<CellSide> sides; ///< of cells with boxes
    /// What a node that hangs takes of those that do not; empty for those.
    std::vector<NodeShares> hanging;
    std::vector<LatticePart> parts;
    /// Cells are cubes along the axes, which parts may fill in part. If not, each is all
    /// of one material.
    bool has_boxes = true;
    /// Ever coarser lattices, for solvers: of each the shares that the nodes of the one
    /// below it take of its nodes; none where a node hangs.
    struct Coarser
    {
        std::size_t num_nodes = 0;
        SparseRows below;
    };
    std::vector<Coarser> coarser;

    double edge(int cell) const ///< of a box [m]
    {
        const CornerNodes& nodes = cells[idx(cell)];
        return places[idx(nodes[1])].x() - places[idx(nodes[0])].x();
    }
};

/// The pieces of an octree as boxes, whose corners are united where the glue joins them.
/// \p unit: of the cells' lengths [m].
Lattice octree_lattice(const Octree& octree, const Cells& cells, double unit);

/// Parts of the octree's lattice by the material of each voxel, \p material, in the order
/// of the cells and materials. \p unit: of the grid [m].
std::vector<LatticePart> parts_by_material(const VoxelGrid& grid, const Octree& octree,
                                           const Pieces& pieces,
                                           std::span<const int> material, double unit);

/// A hexahedron that is turned inside out somewhere.
struct InvertedHexahedron : std::invalid_argument
{
    explicit InvertedHexahedron(std::size_t which);
    std::size_t number; ///< from 0
};

/// Hexahedra that were drawn; \p material of each. Throws InvertedHexahedron.
Lattice drawn_lattice(std::vector<Eigen::Vector3d> places, std::vector<CornerNodes> cells,
                      std::span<const int> material);

/// Where a point lies in a cell, in [0, 1] along each axis if it is inside; nothing where
/// a bent cell has no such place.
std::optional<Eigen::Vector3d> local_place(const Lattice& lattice, int cell,
                                           const Eigen::Vector3d& x);

/// Shares of the nodes that do not hang, at a place of a cell.
NodeShares shares_at(const Lattice& lattice, int cell, const Eigen::Vector3d& local);

/// The cell's map from [0, 1]^3, and its slopes: column i by local coordinate i.
Eigen::Vector3d cell_point(const Lattice& lattice, int cell,
                           const Eigen::Vector3d& local);
Eigen::Matrix3d cell_slopes(const Lattice& lattice, int cell,
                            const Eigen::Vector3d& local);

} // namespace cellwarp::core
