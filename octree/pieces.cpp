// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/pieces.h"

#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/union_find.h"
#include "octree/hold_together.h"

namespace cellwarp::core
{

namespace
{

/// Voxels of one material that follow each other in a row of a leaf, and their piece.
struct Run
{
    int row = 0, begin = 0, end = 0;
    std::uint8_t material = 0;
    int piece = 0;
};

/// The first voxel of a row of a leaf.
std::size_t row_start(const VoxelGrid& grid, const VoxelBlock& block, int row)
{
    return grid.index(block.first +
                      Eigen::Vector3i(0, row % block.width, row / block.width));
}

/// The material of a row of a leaf; rows follow each other along y, then z.
const std::uint8_t* material_row(const VoxelGrid& grid, const VoxelBlock& block, int row)
{
    return &grid.material()[row_start(grid, block, row)];
}

/// Whether voxels of a leaf have open sides.
bool has_notches(const VoxelGrid& grid, const Notches& notches, const VoxelBlock& block)
{
    if (notches.empty())
        return false;
    const int step = grid.shape().voxels_per_leaf;
    for (int k = 0; k < block.width; k += step)
        for (int j = 0; j < block.width; j += step)
            for (int i = 0; i < block.width; i += step)
                if (notches.are_in(grid.box(block.first + Eigen::Vector3i(i, j, k))))
                    return true;
    return false;
}

/// Whether all voxels of a leaf are of one material.
bool is_of_one_material(const VoxelGrid& grid, const VoxelBlock& block)
{
    const std::uint8_t one = *material_row(grid, block, 0);
    if (one == 0)
        return false;
    const std::size_t rest = idx(block.width) - 1;
    for (int row = 0; row < block.width * block.width; ++row)
    {
        const std::uint8_t* const material = material_row(grid, block, row);
        if (material[0] != one || std::memcmp(material, material + 1, rest) != 0)
            return false;
    }
    return true;
}

/// The runs of one leaf. Those of one material in neighbouring rows that overlap are of
/// one piece; pieces are numbered from 0 in the order of their first voxels. Returns how
/// many there are. \p notches: of the leaf, or none.
int label_runs(const VoxelGrid& grid, const Notches& notches, const VoxelBlock& block,
               std::vector<Run>& runs)
{
    const auto add_run = [&](int row, int begin, int end, std::uint8_t material)
    {
        if (!notches.empty())
            for (int x = begin; x + 1 < end; ++x)
                if (notches.is_open(row_start(grid, block, row) + idx(x), 0))
                {
                    runs.push_back({row, begin, x + 1, material});
                    begin = x + 1;
                }
        runs.push_back({row, begin, end, material});
    };
    // Whether two runs hold together: \p below along the axis has a side that is not
    // open.
    const auto touch = [&](const Run& below, const Run& above, int axis)
    {
        const int begin = std::max(below.begin, above.begin);
        const int end = std::min(below.end, above.end);
        if (notches.empty())
            return begin < end;
        for (int x = begin; x < end; ++x)
            if (!notches.is_open(row_start(grid, block, below.row) + idx(x), axis))
                return true;
        return false;
    };
    const int num_rows = block.width * block.width;
    std::vector<std::size_t> first_run; // of each row, and the end
    first_run.reserve(idx(num_rows) + 1);
    for (int row = 0; row < num_rows; ++row)
    {
        first_run.push_back(runs.size());
        for_each_equal(material_row(grid, block, row), block.width,
                       [&](int begin, int end, std::uint8_t material)
                       {
                           if (material != 0)
                               add_run(row, begin, end, material);
                       });
    }
    first_run.push_back(runs.size());
    UnionFind joined(runs.size());
    const auto join = [&](std::size_t row, std::size_t other, int axis)
    {
        std::size_t a = first_run[row], b = first_run[other];
        while (a < first_run[row + 1] && b < first_run[other + 1])
        {
            if (runs[a].material == runs[b].material && touch(runs[b], runs[a], axis))
                joined.join(static_cast<int>(a), static_cast<int>(b));
            ++(runs[a].end < runs[b].end ? a : b);
        }
    };
    const std::size_t width = idx(block.width);
    for (std::size_t row = 0; row < idx(num_rows); ++row)
    {
        if (row % width != 0)
            join(row, row - 1, 1);
        if (row >= width)
            join(row, row - width, 2);
    }
    int count = 0;
    for (std::size_t k = 0; k < runs.size(); ++k)
    {
        const std::size_t root = idx(joined.first_of(static_cast<int>(k)));
        runs[k].piece = root == k ? count++ : runs[root].piece;
    }
    return count;
}

/// A piece below this share of its leaf, beside another one there, is a crumb: a notch
/// in a soup leaves such. As a cell of its own it would dangle by a voxel's face.
constexpr double kCrumb = 0.02;

} // namespace

/// Finds the pieces of one octree.
class PieceFinder
{
public:
    PieceFinder(const VoxelGrid& grid, const Octree& octree, const Notches& notches)
        : grid_(grid), octree_(octree), notches_(notches), leaves_(pieces_.leaves_)
    {
    }

    /// \p other, \p of_other: from which leaves that are in both are taken; null: none.
    Pieces found(const Octree* other, const Pieces* of_other) &&
    {
        std::vector<LeafNumber> same(octree_.leaves().size(), LeafNumber::None);
        if (other)
            same = octree_.numbers_in(*other);
        leaves_.resize(same.size() + 1);
        parallel_for(same.size(),
                     [&](std::size_t i)
                     {
                         if (same[i] == LeafNumber::None)
                             label(i);
                         else
                             take_over(i, of_other->leaves_[idx(same[i])]);
                     });
        std::size_t count = 0;
        for (Pieces::OfLeaf& leaf : leaves_)
        {
            leaf.first_local = count;
            count += idx(leaf.num_locals);
        }
        pieces_.numbers_.resize(count);
        std::iota(pieces_.numbers_.begin(), pieces_.numbers_.end(), 0);
        place_leaves();
        number_pieces(adopters());
        return std::move(pieces_);
    }

private:
    VoxelBlock block_of(std::size_t leaf) const
    {
        return voxel_block(grid_.shape(), octree_.leaves()[leaf]);
    }

    void label(std::size_t leaf)
    {
        const VoxelBlock block = block_of(leaf);
        Pieces::OfLeaf& of = leaves_[leaf];
        const bool has_any = has_notches(grid_, notches_, block);
        of.is_full = is_of_one_material(grid_, block) && !has_any;
        of.num_locals = 1;
        if (of.is_full)
            return;
        std::vector<Run> runs;
        of.num_locals = label_runs(grid_, has_any ? notches_ : none_, block, runs);
        if (of.num_locals < 2)
            return;
        const std::size_t width = idx(block.width);
        auto labels = std::make_shared<Pieces::Labels>();
        labels->block = block;
        labels->locals.assign(width * width * width, -1);
        for (const Run& run : runs)
            std::fill_n(labels->locals.data() + idx(run.row) * width + idx(run.begin),
                        run.end - run.begin, run.piece);
        of.labels = std::move(labels);
    }

    void take_over(std::size_t leaf, const Pieces::OfLeaf& from)
    {
        leaves_[leaf].labels = from.labels;
        leaves_[leaf].num_locals = from.num_locals;
        leaves_[leaf].is_full = from.is_full;
    }

    /// Fills leaf_of_box_.
    void place_leaves()
    {
        pieces_.leaf_of_box_ = VoxelNumbers<std::int32_t>(grid_.num_boxes());
        parallel_for(octree_.leaves().size(),
                     [&](std::size_t i)
                     {
                         const VoxelBlock block = block_of(i);
                         const int step = grid_.shape().voxels_per_leaf;
                         const std::size_t boxes = idx(block.width / step);
                         for (int k = 0; k < block.width; k += step)
                             for (int j = 0; j < block.width; j += step)
                                 pieces_.leaf_of_box_.fill(
                                     grid_.box(block.first + Eigen::Vector3i(0, j, k)),
                                     boxes, static_cast<std::int32_t>(i));
                     });
    }

    /// Marks the crumbs of one leaf among all local pieces.
    bool mark_crumbs(std::size_t leaf, std::vector<char>& is_crumb) const
    {
        const Pieces::OfLeaf& of = leaves_[leaf];
        std::vector<int> sizes(idx(of.num_locals), 0);
        for (const std::int32_t local : of.labels->locals)
            if (local >= 0)
                ++sizes[idx(local)];
        const double least = kCrumb * std::pow(of.labels->block.width, 3);
        bool has_any = false;
        for (std::size_t k = 0; k < sizes.size(); ++k)
            if (sizes[k] < least)
            {
                is_crumb[of.first_local + k] = 1;
                has_any = true;
            }
        return has_any;
    }

    /// For each crumb of a leaf the whole pieces with which it has faces in common.
    std::map<std::int32_t, std::set<std::int32_t>>
    touches_of(std::size_t leaf, const std::vector<char>& is_crumb) const
    {
        std::map<std::int32_t, std::set<std::int32_t>> touches;
        const auto look_around = [&](std::int32_t piece, const Eigen::Vector3i& voxel)
        {
            for_each_beside(voxel,
                            [&](const Eigen::Vector3i& next)
                            {
                                if (!grid_.contains(next))
                                    return;
                                const std::int32_t other = pieces_.at(grid_, next);
                                if (other >= 0 && other != piece &&
                                    !is_crumb[idx(other)] &&
                                    hold_together(grid_, notches_, voxel, next))
                                    touches[piece].insert(other);
                            });
        };
        const VoxelBlock block = block_of(leaf);
        pieces_.for_each_run(grid_, block, LeafNumber(leaf),
                             [&](int y, int z, int begin, int end, std::int32_t piece)
                             {
                                 if (!is_crumb[idx(piece)])
                                     return;
                                 for (int x = begin; x < end; ++x)
                                     look_around(piece,
                                                 block.first + Eigen::Vector3i(x, y, z));
                             });
        return touches;
    }

    /// For each local piece that is a crumb the one of another leaf that it touches, for
    /// all others -1. One that touches several is no crumb: it may be all that joins
    /// them.
    std::vector<std::int32_t> adopters() const
    {
        std::vector<std::int32_t> adopter(pieces_.numbers_.size(), -1);
        std::vector<char> is_crumb(adopter.size(), 0);
        std::vector<std::size_t> crumbly; // leaves
        for (std::size_t leaf = 0; leaf + 1 < leaves_.size(); ++leaf)
            if (leaves_[leaf].labels && mark_crumbs(leaf, is_crumb))
                crumbly.push_back(leaf);
        std::vector<std::map<std::int32_t, std::set<std::int32_t>>> touches(
            crumbly.size());
        parallel_for(crumbly.size(), [&](std::size_t k)
                     { touches[k] = touches_of(crumbly[k], is_crumb); });
        for (const auto& of_leaf : touches)
            for (const auto& [piece, others] : of_leaf)
                if (others.size() == 1)
                    adopter[idx(piece)] = *others.begin();
        return adopter;
    }

    /// Numbers what is no crumb of another leaf, and gives crumbs the numbers of theirs.
    void number_pieces(const std::vector<std::int32_t>& adopter)
    {
        std::vector<std::size_t> leaf_of_local(adopter.size());
        for (std::size_t leaf = 0; leaf < leaves_.size(); ++leaf)
        {
            Pieces::OfLeaf& of = leaves_[leaf];
            of.first = static_cast<std::int32_t>(pieces_.size());
            for (std::size_t k = of.first_local; k < of.first_local + idx(of.num_locals);
                 ++k)
            {
                leaf_of_local[k] = leaf;
                if (adopter[k] >= 0)
                    continue;
                pieces_.numbers_[k] = static_cast<std::int32_t>(pieces_.size());
                pieces_.leaf_of_piece_.push_back(LeafNumber(leaf));
            }
        }
        for (std::size_t k = 0; k < adopter.size(); ++k)
            if (adopter[k] >= 0)
            {
                pieces_.numbers_[k] = pieces_.numbers_[idx(adopter[k])];
                leaves_[leaf_of_local[k]].shares_crumbs = true;
                leaves_[leaf_of_local[idx(adopter[k])]].shares_crumbs = true;
            }
    }

    const VoxelGrid& grid_;
    const Octree& octree_;
    const Notches& notches_;
    const Notches none_;
    Pieces pieces_;
    std::vector<Pieces::OfLeaf>& leaves_; ///< of pieces_
};

Pieces find_pieces(const VoxelGrid& grid, const Octree& octree, const Notches& notches)
{
    return PieceFinder(grid, octree, notches).found(nullptr, nullptr);
}

Pieces find_pieces(const VoxelGrid& grid, const Octree& octree, const Notches& notches,
                   const Octree& other, const Pieces& of_other)
{
    return PieceFinder(grid, octree, notches).found(&other, &of_other);
}

} // namespace cellwarp::core
