// SPDX-License-Identifier: GPL-3.0-or-later
// Pieces: the connected parts of the material inside each leaf. Usually one a
// leaf, two where two fingers pass through the same box.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "octree/octree.h"
#include "octree/voxel_grid.h"

namespace cellwarp
{

/// Sorted by leaf; within a leaf by first voxel. Crumbs, pieces too small to be bodies
/// beside another one in their leaf that touch just one piece of the other leaves, belong
/// to that piece: what is there follows it, but they count for nothing else.
struct Pieces
{
    std::vector<LeafNumber> leaf_of_piece;
    VoxelNumbers<std::int32_t> piece_of_voxel; ///< -1 where there is no material
    std::size_t size() const { return leaf_of_piece.size(); }
};

Pieces find_pieces(const VoxelGrid& grid, const Octree& octree);

/// The piece that holds a point: that of its voxel, or else the first of those that it
/// touches; -1 if it touches no material. \p piece_of_voxel: negative where there is
/// none.
template <class PieceOfVoxel>
std::int32_t piece_at(const VoxelGrid& grid, const PieceOfVoxel& piece_of_voxel,
                      const Eigen::Vector3d& x)
{
    std::int32_t piece = piece_of_voxel[grid.index(grid.locate(x))];
    if (piece < 0)
        for_each_voxel(grid.touched(x),
                       [&](const Eigen::Vector3i& voxel)
                       {
                           if (piece < 0)
                               piece = piece_of_voxel[grid.index(voxel)];
                       });
    return std::max(piece, -1);
}

} // namespace cellwarp
