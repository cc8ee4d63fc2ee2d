// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/pieces.h"

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

/// Numbers the pieces of one leaf from 0 in piece_of_voxel; returns their count.
int label_leaf(const VoxelGrid& grid, const VoxelBlock& block,
               std::vector<std::int32_t>& piece_of_voxel)
{
    const std::vector<std::uint8_t>& material = grid.material();
    const Eigen::Vector3i end = (block.first.array() + block.width).matrix();
    int count = 0;
    std::vector<Eigen::Vector3i> stack;
    for (int k = block.first.z(); k < end.z(); ++k)
        for (int j = block.first.y(); j < end.y(); ++j)
            for (int i = block.first.x(); i < end.x(); ++i)
            {
                const std::size_t seed = grid.index(i, j, k);
                if (!material[seed] || piece_of_voxel[seed] >= 0)
                    continue;
                piece_of_voxel[seed] = count;
                stack.assign(1, {i, j, k});
                while (!stack.empty())
                {
                    const Eigen::Vector3i voxel = stack.back();
                    stack.pop_back();
                    for (int axis = 0; axis < 3; ++axis)
                        for (const int step : {-1, 1})
                        {
                            Eigen::Vector3i next = voxel;
                            next[axis] += step;
                            if (next[axis] < block.first[axis] || next[axis] >= end[axis])
                                continue;
                            const std::size_t at = grid.index(next);
                            if (material[at] && piece_of_voxel[at] < 0)
                            {
                                piece_of_voxel[at] = count;
                                stack.push_back(next);
                            }
                        }
                }
                ++count;
            }
    return count;
}

} // namespace

Pieces find_pieces(const VoxelGrid& grid, const Octree& octree)
{
    const std::vector<Leaf>& leaves = octree.leaves();
    Pieces pieces;
    pieces.piece_of_voxel.assign(grid.size(), -1);
    std::vector<int> counts(leaves.size());
    parallel_for(leaves.size(),
                 [&](std::size_t i)
                 {
                     counts[i] = label_leaf(grid, voxel_block(grid.shape(), leaves[i]),
                                            pieces.piece_of_voxel);
                 });
    std::vector<std::int32_t> first(leaves.size());
    for (std::size_t i = 0; i < leaves.size(); ++i)
    {
        first[i] = static_cast<std::int32_t>(pieces.size());
        pieces.leaf_of_piece.insert(pieces.leaf_of_piece.end(),
                                    static_cast<std::size_t>(counts[i]),
                                    static_cast<int>(i));
    }
    parallel_for(leaves.size(),
                 [&](std::size_t i)
                 {
                     const VoxelBlock block = voxel_block(grid.shape(), leaves[i]);
                     for (int k = 0; k < block.width; ++k)
                         for (int j = 0; j < block.width; ++j)
                             for (int x = 0; x < block.width; ++x)
                             {
                                 std::int32_t& piece = pieces.piece_of_voxel[grid.index(
                                     block.first.x() + x, block.first.y() + j,
                                     block.first.z() + k)];
                                 if (piece >= 0)
                                     piece += first[i];
                             }
                 });
    return pieces;
}

} // namespace cellwarp
