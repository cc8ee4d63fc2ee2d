// SPDX-License-Identifier: GPL-3.0-or-later
// Pieces: the connected parts of the material inside each leaf. Usually one a
// leaf, two where two fingers pass through the same box.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "octree/notches.h"
#include "octree/octree.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// Sorted by leaf; within a leaf by first voxel. Crumbs, pieces too small to be bodies
/// beside another one in their leaf that touch just one piece of the other leaves, belong
/// to that piece: what is there follows it, but they count for nothing else.
///
/// Kept by leaf: only where a leaf holds several pieces there is a number for each of its
/// voxels. So little is written where an octree changes little. Whether a voxel is
/// material at all the grid tells, which therefore is a part of every question.
/// Immutable once built.
class Pieces
{
public:
    std::size_t size() const { return leaf_of_piece_.size(); }
    LeafNumber leaf(std::int32_t piece) const { return leaf_of_piece_[idx(piece)]; }
    /// A leaf's own pieces are [first, end): none where all that it holds are crumbs.
    std::int32_t first(LeafNumber leaf) const { return leaves_[idx(leaf)].first; }
    std::int32_t end(LeafNumber leaf) const { return leaves_[idx(leaf) + 1].first; }

    /// The piece that holds a voxel; -1 where there is no material.
    std::int32_t at(const VoxelGrid& grid, const Eigen::Vector3i& voxel) const
    {
        if (!grid.material()[grid.index(voxel)])
            return -1;
        const OfLeaf& leaf = leaves_[idx(leaf_of_box_[grid.box(voxel)])];
        return numbers_[leaf.first_local + leaf.local(voxel)];
    }
    std::int32_t at(const VoxelGrid& grid, std::size_t voxel) const
    {
        return at(grid, grid.coordinates(voxel));
    }

    /// The leaf that holds a finest box (see VoxelGrid::box()); None without material.
    LeafNumber leaf_of_box(std::size_t box) const
    {
        return LeafNumber(leaf_of_box_[box]);
    }
    /// The piece that has all the material of a leaf; -1 where several share it.
    std::int32_t only(LeafNumber leaf) const
    {
        const OfLeaf& of = leaves_[idx(leaf)];
        return of.num_locals == 1 ? numbers_[of.first_local] : -1;
    }
    /// Whether every voxel of a leaf is material of one piece, none with an open side.
    bool is_full(LeafNumber leaf) const { return leaves_[idx(leaf)].is_full; }
    /// Whether crumbs in this leaf belong to pieces of other leaves, or the other way
    /// round.
    bool shares_crumbs(LeafNumber leaf) const { return leaves_[idx(leaf)].shares_crumbs; }

    /// Calls visit(voxel, piece) for all material, ascending.
    template <class Visit>
    void for_each(const VoxelGrid& grid, Visit&& visit) const
    {
        const Eigen::Vector3i& counts = grid.counts();
        for (int k = 0; k < counts.z(); ++k)
            for (int j = 0; j < counts.y(); ++j)
            {
                const std::size_t row = grid.index(0, j, k);
                for_each_set(
                    grid.material(), row, row + idx(counts.x()),
                    [&](std::size_t voxel) {
                        visit(voxel, at(grid, {static_cast<int>(voxel - row), j, k}));
                    });
            }
    }
    /// Calls visit(y, z, begin, end, piece) for each run of voxels of one piece along the
    /// rows of a leaf, which are counted from its first voxel.
    template <class Visit>
    void for_each_run(const VoxelGrid& grid, const VoxelBlock& block, LeafNumber leaf,
                      Visit&& visit) const;

private:
    friend class PieceFinder;

    /// For each voxel of a leaf the number of its piece there, crumbs counted as well;
    /// -1 where there is no material.
    struct Labels
    {
        VoxelBlock block;
        std::vector<std::int32_t> locals;
    };
    struct OfLeaf
    {
        std::shared_ptr<const Labels> labels = nullptr; ///< null: there is one piece
        std::int32_t num_locals = 0;
        bool is_full = false;
        bool shares_crumbs = false;
        std::int32_t first = 0;      ///< of its own pieces
        std::size_t first_local = 0; ///< in numbers_

        std::size_t local(const Eigen::Vector3i& voxel) const
        {
            if (!labels)
                return 0;
            const Eigen::Vector3i at = voxel - labels->block.first;
            const std::size_t width = idx(labels->block.width);
            return idx(labels->locals[(idx(at.z()) * width + idx(at.y())) * width +
                                      idx(at.x())]);
        }
    };

    std::vector<LeafNumber> leaf_of_piece_;
    std::vector<OfLeaf> leaves_;        ///< and one for their end
    std::vector<std::int32_t> numbers_; ///< of all that leaves hold: the piece
    VoxelNumbers<std::int32_t> leaf_of_box_;
};

/// The pieces of \p octree, from nothing. Nothing holds together across open sides of
/// \p notches.
Pieces find_pieces(const VoxelGrid& grid, const Octree& octree,
                   const Notches& notches = {});

/// The same, to the bit, in proportion to what is new: leaves that are also in \p other
/// are taken over from its pieces.
Pieces find_pieces(const VoxelGrid& grid, const Octree& octree, const Notches& notches,
                   const Octree& other, const Pieces& of_other);

/// The piece that holds a point: that of its voxel, or else the first of those that it
/// touches; -1 if it touches no material. \p piece_of(voxel): negative where there is
/// none.
template <class PieceOf>
std::int32_t piece_at(const VoxelGrid& grid, const PieceOf& piece_of,
                      const Eigen::Vector3d& x)
{
    std::int32_t piece = piece_of(grid.locate(x));
    if (piece < 0)
        for_each_voxel(grid.touched(x),
                       [&](const Eigen::Vector3i& voxel)
                       {
                           if (piece < 0)
                               piece = piece_of(voxel);
                       });
    return std::max(piece, -1);
}
inline std::int32_t piece_at(const VoxelGrid& grid, const Pieces& pieces,
                             const Eigen::Vector3d& x)
{
    return piece_at(
        grid, [&](const Eigen::Vector3i& voxel) { return pieces.at(grid, voxel); }, x);
}

/// Calls visit(begin, end, value) for the runs of equal values of a row.
template <class Value, class Visit>
void for_each_equal(const Value* row, int width, Visit&& visit)
{
    if (std::memcmp(row, row + 1, sizeof(Value) * (idx(width) - 1)) == 0)
        return visit(0, width, row[0]);
    for (int begin = 0; begin < width;)
    {
        int end = begin + 1;
        while (end < width && row[end] == row[begin])
            ++end;
        visit(begin, end, row[begin]);
        begin = end;
    }
}

template <class Visit>
void Pieces::for_each_run(const VoxelGrid& grid, const VoxelBlock& block, LeafNumber leaf,
                          Visit&& visit) const
{
    const OfLeaf& of = leaves_[idx(leaf)];
    for (int k = 0; k < block.width; ++k)
        for (int j = 0; j < block.width; ++j)
        {
            const auto take = [&](int begin, int end, std::int32_t local)
            {
                if (local >= 0)
                    visit(j, k, begin, end, numbers_[of.first_local + idx(local)]);
            };
            if (of.is_full)
                take(0, block.width, 0);
            else if (of.labels)
                for_each_equal(&of.labels->locals[(idx(k) * idx(block.width) + idx(j)) *
                                                  idx(block.width)],
                               block.width, take);
            else
                for_each_equal(
                    &grid.material()[grid.index(block.first + Eigen::Vector3i(0, j, k))],
                    block.width,
                    [&](int begin, int end, std::uint8_t material)
                    { take(begin, end, material ? 0 : -1); });
        }
}

} // namespace cellwarp::core
