// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/pieces.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp
{

namespace
{

VoxelRange range_of(const VoxelBlock& block)
{
    return {block.first, block.first.array() + (block.width - 1)};
}

/// The first voxels of the rows along x.
std::vector<std::size_t> rows_of(const VoxelGrid& grid, const VoxelBlock& block)
{
    std::vector<std::size_t> rows;
    for (int k = 0; k < block.width; ++k)
        for (int j = 0; j < block.width; ++j)
            rows.push_back(
                grid.index(block.first.x(), block.first.y() + j, block.first.z() + k));
    return rows;
}

/// Numbers the pieces of one leaf from 0 in piece_of_voxel; returns their count.
int label_leaf(const VoxelGrid& grid, const VoxelBlock& block,
               std::vector<std::int32_t>& piece_of_voxel)
{
    const std::vector<std::uint8_t>& material = grid.material();
    const Eigen::Vector3i end = (block.first.array() + block.width).matrix();
    const std::vector<std::size_t> rows = rows_of(grid, block);
    if (std::all_of(rows.begin(), rows.end(),
                    [&](std::size_t row)
                    {
                        return std::all_of(&material[row], &material[row] + block.width,
                                           [](std::uint8_t m) { return m != 0; });
                    }))
    {
        for (const std::size_t row : rows)
            std::fill_n(&piece_of_voxel[row], block.width, 0);
        return 1;
    }
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

/// A piece below this share of its leaf, beside another one there, is a crumb: a notch
/// in a soup leaves such. As a cell of its own it would dangle by a voxel's face.
constexpr double kCrumb = 0.02;

/// Which pieces of one leaf are crumbs. \p first: number of its first piece.
std::vector<bool> crumbs_of(const VoxelGrid& grid, const VoxelBlock& block,
                            const Pieces& pieces, std::int32_t first, std::size_t count)
{
    std::vector<int> sizes(count, 0);
    for_each_voxel(range_of(block),
                   [&](const Eigen::Vector3i& voxel)
                   {
                       const std::int32_t piece =
                           pieces.piece_of_voxel[grid.index(voxel)];
                       if (piece >= 0)
                           ++sizes[idx(piece - first)];
                   });
    const double least = kCrumb * std::pow(block.width, 3);
    std::vector<bool> is_crumb;
    for (const int size : sizes)
        is_crumb.push_back(size < least);
    return is_crumb;
}

/// For each crumb of a leaf the whole pieces with which it has faces in common.
std::map<std::int32_t, std::set<std::int32_t>>
touches_of(const VoxelGrid& grid, const VoxelBlock& block, const Pieces& pieces,
           const std::vector<bool>& is_crumb)
{
    const auto piece_at = [&](const Eigen::Vector3i& voxel)
    { return pieces.piece_of_voxel[grid.index(voxel)]; };
    std::map<std::int32_t, std::set<std::int32_t>> touches;
    for_each_voxel(range_of(block),
                   [&](const Eigen::Vector3i& voxel)
                   {
                       const std::int32_t piece = piece_at(voxel);
                       if (piece < 0 || !is_crumb[idx(piece)])
                           return;
                       for (int axis = 0; axis < 3; ++axis)
                           for (const int step : {-1, 1})
                           {
                               Eigen::Vector3i next = voxel;
                               next[axis] += step;
                               if (!grid.contains(next))
                                   continue;
                               const std::int32_t other = piece_at(next);
                               if (other >= 0 && other != piece && !is_crumb[idx(other)])
                                   touches[piece].insert(other);
                           }
                   });
    return touches;
}

/// For each piece that is a crumb the piece of another leaf that it touches, for all
/// others -1. One that touches several is no crumb: it may be all that joins them.
/// \p first: of each leaf, and the end.
std::vector<std::int32_t> adopters(const VoxelGrid& grid, const Octree& octree,
                                   const Pieces& pieces,
                                   const std::vector<std::int32_t>& first)
{
    std::vector<std::int32_t> adopter(pieces.size(), -1);
    std::vector<bool> is_crumb(pieces.size(), false);
    std::vector<std::size_t> shared; // leaves of several pieces
    for (std::size_t leaf = 0; leaf + 1 < first.size(); ++leaf)
    {
        if (first[leaf + 1] - first[leaf] < 2)
            continue;
        shared.push_back(leaf);
        const std::vector<bool> found =
            crumbs_of(grid, voxel_block(grid.shape(), octree.leaves()[leaf]), pieces,
                      first[leaf], idx(first[leaf + 1] - first[leaf]));
        std::copy(found.begin(), found.end(), is_crumb.begin() + first[leaf]);
    }
    for (const std::size_t leaf : shared)
        for (const auto& [piece, others] :
             touches_of(grid, voxel_block(grid.shape(), octree.leaves()[leaf]), pieces,
                        is_crumb))
            if (others.size() == 1)
                adopter[idx(piece)] = *others.begin();
    return adopter;
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
    std::vector<std::int32_t> first(leaves.size() + 1);
    for (std::size_t i = 0; i < leaves.size(); ++i)
    {
        first[i] = static_cast<std::int32_t>(pieces.size());
        pieces.leaf_of_piece.insert(pieces.leaf_of_piece.end(), idx(counts[i]),
                                    static_cast<int>(i));
    }
    first.back() = static_cast<std::int32_t>(pieces.size());
    const auto renumber = [&](auto&& number_of)
    {
        parallel_for(leaves.size(),
                     [&](std::size_t i)
                     {
                         const VoxelBlock block = voxel_block(grid.shape(), leaves[i]);
                         for (const std::size_t row : rows_of(grid, block))
                             for (int x = 0; x < block.width; ++x)
                             {
                                 std::int32_t& piece =
                                     pieces.piece_of_voxel[row + idx(x)];
                                 if (piece >= 0)
                                     piece = number_of(i, piece);
                             }
                     });
    };
    renumber([&](std::size_t leaf, std::int32_t piece) { return first[leaf] + piece; });
    const std::vector<std::int32_t> adopter = adopters(grid, octree, pieces, first);
    std::vector<std::int32_t> number(pieces.size());
    std::vector<int> leaf_of_kept;
    for (std::size_t piece = 0; piece < pieces.size(); ++piece)
    {
        number[piece] = static_cast<std::int32_t>(leaf_of_kept.size());
        if (adopter[piece] < 0)
            leaf_of_kept.push_back(pieces.leaf_of_piece[piece]);
    }
    if (leaf_of_kept.size() == pieces.size())
        return pieces;
    renumber(
        [&](std::size_t, std::int32_t piece)
        {
            const std::int32_t by = adopter[idx(piece)];
            return number[idx(by < 0 ? piece : by)];
        });
    pieces.leaf_of_piece = std::move(leaf_of_kept);
    return pieces;
}

std::int32_t piece_at(const VoxelGrid& grid, std::span<const std::int32_t> piece_of_voxel,
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
