// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/pieces.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/union_find.h"

namespace cellwarp
{

namespace
{

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

/// Voxels of one material that follow each other in a row of a leaf, and their piece.
struct Run
{
    int row = 0, begin = 0, end = 0;
    std::uint8_t material = 0;
    int piece = 0;
};

/// The runs of one leaf. Those of one material in neighbouring rows that overlap are of
/// one piece; pieces are numbered from 0 in the order of their first voxels.
std::vector<Run> label_leaf(const VoxelGrid& grid, const VoxelBlock& block)
{
    const std::vector<std::size_t> rows = rows_of(grid, block);
    std::vector<Run> runs;
    std::vector<std::size_t> first_run; // of each row, and the end
    for (std::size_t row = 0; row < rows.size(); ++row)
    {
        first_run.push_back(runs.size());
        const std::uint8_t* const material = &grid.material()[rows[row]];
        for (int x = 0; x < block.width;)
        {
            const int begin = x;
            const std::uint8_t own = material[x];
            while (x < block.width && material[x] == own)
                ++x;
            if (own != 0)
                runs.push_back({static_cast<int>(row), begin, x, own});
        }
    }
    first_run.push_back(runs.size());
    UnionFind joined(runs.size());
    const auto join = [&](std::size_t row, std::size_t other)
    {
        std::size_t a = first_run[row], b = first_run[other];
        while (a < first_run[row + 1] && b < first_run[other + 1])
        {
            if (runs[a].begin < runs[b].end && runs[b].begin < runs[a].end &&
                runs[a].material == runs[b].material)
                joined.join(static_cast<int>(a), static_cast<int>(b));
            ++(runs[a].end < runs[b].end ? a : b);
        }
    };
    const std::size_t width = idx(block.width);
    for (std::size_t row = 0; row < rows.size(); ++row)
    {
        if (row % width != 0)
            join(row, row - 1);
        if (row >= width)
            join(row, row - width);
    }
    int count = 0;
    for (std::size_t k = 0; k < runs.size(); ++k)
    {
        const std::size_t root = idx(joined.first_of(static_cast<int>(k)));
        runs[k].piece = root == k ? count++ : runs[root].piece;
    }
    return runs;
}

/// A piece below this share of its leaf, beside another one there, is a crumb: a notch
/// in a soup leaves such. As a cell of its own it would dangle by a voxel's face.
constexpr double kCrumb = 0.02;

/// Which pieces of one leaf are crumbs. \p first: number of its first piece.
std::vector<bool> crumbs_of(const VoxelGrid& grid, const VoxelBlock& block,
                            const Pieces& pieces, std::int32_t first, std::size_t count)
{
    std::vector<int> sizes(count, 0);
    for (const std::size_t row : rows_of(grid, block))
        for (int x = 0; x < block.width; ++x)
            if (const std::int32_t piece = pieces.piece_of_voxel[row + idx(x)];
                piece >= 0)
                ++sizes[idx(piece - first)];
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
    const auto look_around = [&](std::int32_t piece, const Eigen::Vector3i& voxel)
    {
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1})
            {
                Eigen::Vector3i next = voxel;
                next[axis] += step;
                if (!grid.contains(next))
                    continue;
                const std::int32_t other = piece_at(next);
                if (other >= 0 && other != piece && !is_crumb[idx(other)] &&
                    grid.material()[grid.index(next)] ==
                        grid.material()[grid.index(voxel)])
                    touches[piece].insert(other);
            }
    };
    for (const std::size_t row : rows_of(grid, block))
        for (int x = 0; x < block.width; ++x)
            if (const std::int32_t piece = pieces.piece_of_voxel[row + idx(x)];
                piece >= 0 && is_crumb[idx(piece)])
                look_around(piece, grid.coordinates(row + idx(x)));
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
    std::vector<std::size_t> crumbly; // leaves
    for (std::size_t leaf = 0; leaf + 1 < first.size(); ++leaf)
    {
        if (first[leaf + 1] - first[leaf] < 2)
            continue;
        const std::vector<bool> found =
            crumbs_of(grid, voxel_block(grid.shape(), octree.leaves()[leaf]), pieces,
                      first[leaf], idx(first[leaf + 1] - first[leaf]));
        std::copy(found.begin(), found.end(), is_crumb.begin() + first[leaf]);
        if (std::find(found.begin(), found.end(), true) != found.end())
            crumbly.push_back(leaf);
    }
    for (const std::size_t leaf : crumbly)
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
    pieces.piece_of_voxel = VoxelNumbers<std::int32_t>(grid.size());
    std::vector<std::vector<Run>> runs(leaves.size());
    parallel_for(leaves.size(), [&](std::size_t i)
                 { runs[i] = label_leaf(grid, voxel_block(grid.shape(), leaves[i])); });
    std::vector<std::int32_t> first(leaves.size() + 1);
    for (std::size_t i = 0; i < leaves.size(); ++i)
    {
        first[i] = static_cast<std::int32_t>(pieces.size());
        int count = 0;
        for (const Run& run : runs[i])
            count = std::max(count, run.piece + 1);
        pieces.leaf_of_piece.insert(pieces.leaf_of_piece.end(), idx(count),
                                    LeafNumber(i));
    }
    first.back() = static_cast<std::int32_t>(pieces.size());
    const auto write = [&](auto&& number_of)
    {
        parallel_for(leaves.size(),
                     [&](std::size_t i)
                     {
                         const std::vector<std::size_t> rows =
                             rows_of(grid, voxel_block(grid.shape(), leaves[i]));
                         for (const Run& run : runs[i])
                             pieces.piece_of_voxel.fill(rows[idx(run.row)] +
                                                            idx(run.begin),
                                                        idx(run.end - run.begin),
                                                        number_of(first[i] + run.piece));
                     });
    };
    write([](std::int32_t piece) { return piece; });
    const std::vector<std::int32_t> adopter = adopters(grid, octree, pieces, first);
    std::vector<std::int32_t> number(pieces.size());
    std::vector<LeafNumber> leaf_of_kept;
    for (std::size_t piece = 0; piece < pieces.size(); ++piece)
    {
        number[piece] = static_cast<std::int32_t>(leaf_of_kept.size());
        if (adopter[piece] < 0)
            leaf_of_kept.push_back(pieces.leaf_of_piece[piece]);
    }
    if (leaf_of_kept.size() == pieces.size())
        return pieces;
    write(
        [&](std::int32_t piece)
        {
            const std::int32_t by = adopter[idx(piece)];
            return number[idx(by < 0 ? piece : by)];
        });
    pieces.leaf_of_piece = std::move(leaf_of_kept);
    return pieces;
}

} // namespace cellwarp
