// SPDX-License-Identifier: GPL-3.0-or-later
// Cells: the pieces of material as rigid bodies, and the faces where they touch.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/octree.h"
#include "octree/pieces.h"
#include "octree/sheet.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// One rigid body, made of one piece. Lengths in the units of the grid.
struct Cell
{
    LeafNumber leaf{};
    Eigen::Vector3d box_centre = Eigen::Vector3d::Zero(); ///< of the leaf
    double edge = 0.0;                                    ///< of the leaf
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();     ///< centroid of the piece
    /// The point of the cell that moves as the material there does. Glue balances where
    /// cells agree with a deformation at the centres of their boxes (derived in
    /// glue.cpp), so it is the centre of the box; the piece's centroid if the box holds
    /// other pieces.
    Eigen::Vector3d anchor = Eigen::Vector3d::Zero();
    double volume = 0.0;
    /// (1/V) int (x - centre)(x - centre)^T over the piece.
    Eigen::Matrix3d second_moment = Eigen::Matrix3d::Zero();
    /// Centroid of the sheets in the piece; of the piece where there are none.
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
};

/// Where two cells touch: cell a below cell b along the axis.
struct Face
{
    int a = 0, b = 0;
    int axis = 0;
    double area = 0.0;                                ///< of the material's cross-section
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(); ///< of what they share
    double distance = 0.0; ///< of the boxes' centres along the axis
    /// With M: a relative turn by omega opens the cross-section, on average over it and
    /// squared, by omega^T M omega [length^2]. cells.cpp says what counts.
    Eigen::Matrix3d turning = Eigen::Matrix3d::Zero();
    double sheet_share = 0.0; ///< of the cross-section
    double contact = 0.0;     ///< area where voxels of both touch
};

/// Rest state: immutable once built. Faces are sorted by (a, axis, b).
struct Cells
{
    /// First corner of the octree's lattice: from here to its box every leaf is a whole
    /// number of its edges.
    Eigen::Vector3d corner = Eigen::Vector3d::Zero();
    std::vector<Cell> cells;
    std::vector<Face> faces;
    std::vector<int> first_neighbour; ///< cells + 1 offsets into neighbours
    std::vector<int> neighbours;      ///< cells glued to a cell, ascending

    std::size_t size() const { return cells.size(); }
    std::span<const int> neighbours_of(int cell) const
    {
        const std::size_t first = idx(first_neighbour[idx(cell)]);
        const std::size_t end = idx(first_neighbour[idx(cell) + 1]);
        return std::span(neighbours).subspan(first, end - first);
    }
};

/// Cells of the same material, made of another octree.
struct EarlierCells
{
    const Octree& octree;
    const Pieces& pieces;
    const Cells& cells;
};

/// Without \p sheets all material is as thick as its voxels. There are no faces in open
/// sides of \p notches, which are those of \p pieces. What leaves have in common
/// with \p earlier cells is taken over from those, to the same bits.
Cells build_cells(const VoxelGrid& grid, const Octree& octree, const Pieces& pieces,
                  const VoxelFlags& is_sheet = {}, const Sheets& sheets = {},
                  const Notches& notches = {}, const EarlierCells* earlier = nullptr);

/// Number of the connected component of each cell (through the glue), numbered by
/// their first cells.
std::vector<int> connected_components(const Cells& cells);

} // namespace cellwarp::core
