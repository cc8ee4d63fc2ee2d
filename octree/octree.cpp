// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/octree.h"

#include <algorithm>
#include <numeric>

#include "octree/base/index.h"
#include "octree/base/morton.h"

namespace cellwarp::core
{

Octree::Octree(const GridShape& shape, const MaterialTest& has_material)
    : counts_(shape.coarsest * shape.leaves_per_coarsest()), max_depth_(shape.max_depth)
{
    const int width = shape.leaves_per_coarsest();
    for (int k = 0; k < shape.coarsest.z(); ++k)
        for (int j = 0; j < shape.coarsest.y(); ++j)
            for (int i = 0; i < shape.coarsest.x(); ++i)
            {
                const Leaf leaf{Eigen::Vector3i(i, j, k) * width, 0};
                if (has_material(leaf))
                    leaves_.push_back(leaf);
            }
    sort();
}

Octree::Octree(std::vector<Leaf> leaves, const Eigen::Vector3i& counts, int max_depth)
    : leaves_(std::move(leaves)), counts_(counts), max_depth_(max_depth)
{
    sort();
}

std::uint64_t Octree::key(const Leaf& leaf) const
{
    return morton(leaf.corner);
}

void Octree::sort()
{
    std::sort(leaves_.begin(), leaves_.end(),
              [&](const Leaf& a, const Leaf& b) { return key(a) < key(b); });
    keys_.resize(leaves_.size());
    std::transform(leaves_.begin(), leaves_.end(), keys_.begin(),
                   [&](const Leaf& leaf) { return key(leaf); });
}

LeafNumber Octree::find(const Eigen::Vector3i& finest) const
{
    if ((finest.array() < 0).any() || (finest.array() >= counts_.array()).any())
        return LeafNumber::None;
    const auto after = std::upper_bound(keys_.begin(), keys_.end(), morton(finest));
    if (after == keys_.begin())
        return LeafNumber::None;
    const std::size_t at = idx(after - keys_.begin()) - 1;
    const Leaf& leaf = leaves_[at];
    const bool is_inside = (finest.array() >= leaf.corner.array()).all() &&
                           (finest.array() < leaf.corner.array() + width(leaf)).all();
    return is_inside ? LeafNumber(at) : LeafNumber::None;
}

std::vector<LeafNumber> Octree::numbers_in(const Octree& other) const
{
    std::vector<LeafNumber> numbers(leaves_.size(), LeafNumber::None);
    std::size_t at = 0; // both are in Morton order
    for (std::size_t i = 0; i < leaves_.size(); ++i)
    {
        while (at < other.leaves_.size() && other.keys_[at] < keys_[i])
            ++at;
        if (at < other.leaves_.size() && other.leaves_[at] == leaves_[i])
            numbers[i] = LeafNumber(at);
    }
    return numbers;
}

Leaf Octree::parent(const Leaf& leaf) const
{
    const int w = 2 * width(leaf);
    return {leaf.corner / w * w, leaf.level - 1};
}

std::vector<LeafNumber> Octree::face_neighbours(const Leaf& box) const
{
    std::vector<LeafNumber> found;
    const int w = width(box);
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {-1, w})
        {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            Eigen::Vector3i place = box.corner;
            place[axis] += side;
            // Finest boxes along the face; a larger neighbour is met again and again.
            for (int j = 0; j < w; ++j)
                for (int i = 0; i < w; ++i)
                {
                    place[u] = box.corner[u] + i;
                    place[v] = box.corner[v] + j;
                    const LeafNumber leaf = find(place);
                    if (leaf != LeafNumber::None)
                        found.push_back(leaf);
                }
        }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
}

std::vector<LeafNumber> Octree::unbalanced() const
{
    std::vector<LeafNumber> coarse;
    for (const Leaf& leaf : leaves_)
    {
        // A neighbour two levels coarser is found from any box of the face.
        const int w = width(leaf);
        for (int axis = 0; axis < 3; ++axis)
            for (const int side : {-1, w})
            {
                Eigen::Vector3i place = leaf.corner;
                place[axis] += side;
                const LeafNumber other = find(place);
                if (other != LeafNumber::None && (*this)[other].level < leaf.level - 1)
                    coarse.push_back(other);
            }
    }
    std::sort(coarse.begin(), coarse.end());
    coarse.erase(std::unique(coarse.begin(), coarse.end()), coarse.end());
    return coarse;
}

bool Octree::is_balanced() const
{
    return unbalanced().empty();
}

Octree Octree::split(std::span<const LeafNumber> leaves,
                     const MaterialTest& has_material) const
{
    std::vector<LeafNumber> wanted(leaves.begin(), leaves.end());
    Octree tree = *this;
    while (!wanted.empty())
    {
        std::vector<bool> is_split(tree.leaves_.size(), false);
        for (const LeafNumber leaf : wanted)
            is_split[idx(leaf)] = tree[leaf].level < max_depth_;
        std::vector<Leaf> next;
        for (std::size_t i = 0; i < tree.leaves_.size(); ++i)
        {
            const Leaf& leaf = tree.leaves_[i];
            if (!is_split[i])
            {
                next.push_back(leaf);
                continue;
            }
            const int half = width(leaf) / 2;
            for (int child = 0; child < 8; ++child)
            {
                const Leaf part{leaf.corner + half * Eigen::Vector3i(child & 1,
                                                                     child >> 1 & 1,
                                                                     child >> 2 & 1),
                                leaf.level + 1};
                if (has_material(part))
                    next.push_back(part);
            }
        }
        tree = Octree(std::move(next), counts_, max_depth_);
        wanted = tree.unbalanced();
    }
    return tree;
}

Octree Octree::split_all(int level, const MaterialTest& has_material) const
{
    Octree tree = *this;
    for (int done = 0; done < level; ++done)
    {
        std::vector<LeafNumber> all;
        for (const LeafNumber leaf : tree.numbers())
            if (tree[leaf].level < level)
                all.push_back(leaf);
        tree = tree.split(all, has_material);
    }
    return tree;
}

Octree Octree::merge(std::span<const LeafNumber> leaves) const
{
    std::vector<Leaf> boxes;
    for (const LeafNumber leaf : leaves)
        if ((*this)[leaf].level > 0)
            boxes.push_back(parent((*this)[leaf]));
    return merge_into(std::move(boxes));
}

Octree Octree::merge_all() const
{
    std::vector<Leaf> boxes;
    for (const Leaf& leaf : leaves_)
    {
        const Leaf box = parent(leaf);
        if ((box.corner.array() + width(box) <= counts_.array()).all())
            boxes.push_back(box);
    }
    return merge_into(std::move(boxes));
}

/// The boxes whose parts are all leaves in place of these, where balance allows it.
Octree Octree::merge_into(std::vector<Leaf> boxes) const
{
    std::sort(boxes.begin(), boxes.end(),
              [&](const Leaf& a, const Leaf& b)
              { return std::pair(key(a), a.level) < std::pair(key(b), b.level); });
    boxes.erase(std::unique(boxes.begin(), boxes.end()), boxes.end());
    // Merging makes nothing finer: boxes that may merge may do so together.
    std::vector<Leaf> next;
    std::vector<bool> is_merged(leaves_.size(), false);
    for (const Leaf& box : boxes)
    {
        // The leaves of a box stand together in Morton order.
        const std::size_t begin =
            idx(std::lower_bound(keys_.begin(), keys_.end(), key(box)) - keys_.begin());
        std::size_t end = begin;
        bool may_merge = true;
        for (; end < leaves_.size() && is_inside(leaves_[end], box); ++end)
            may_merge &= leaves_[end].level == box.level + 1;
        for (const LeafNumber neighbour : face_neighbours(box))
            may_merge &= (*this)[neighbour].level <= box.level + 1;
        if (!may_merge)
            continue;
        std::fill(is_merged.begin() + static_cast<std::ptrdiff_t>(begin),
                  is_merged.begin() + static_cast<std::ptrdiff_t>(end), true);
        next.push_back(box);
    }
    for (std::size_t i = 0; i < leaves_.size(); ++i)
        if (!is_merged[i])
            next.push_back(leaves_[i]);
    return Octree(std::move(next), counts_, max_depth_);
}

std::vector<std::vector<LeafNumber>> Octree::siblings() const
{
    std::vector<std::vector<LeafNumber>> families;
    for (std::size_t begin = 0; begin < leaves_.size();)
    {
        const Leaf& one = leaves_[begin];
        const Leaf box = parent(one);
        std::size_t end = begin + 1;
        // The first part of a box that has material comes first in Morton order.
        while (one.level > 0 && end < leaves_.size() && leaves_[end].level == one.level &&
               is_inside(leaves_[end], box))
            ++end;
        const bool is_whole = one.level > 0 &&
                              (begin == 0 || !is_inside(leaves_[begin - 1], box)) &&
                              (end == leaves_.size() || !is_inside(leaves_[end], box));
        if (is_whole)
        {
            std::vector<LeafNumber>& family = families.emplace_back();
            for (std::size_t i = begin; i < end; ++i)
                family.push_back(LeafNumber(i));
        }
        begin = end;
    }
    return families;
}

bool Octree::is_inside(const Leaf& leaf, const Leaf& box) const
{
    return (leaf.corner.array() >= box.corner.array()).all() &&
           (leaf.corner.array() < box.corner.array() + width(box)).all();
}

VoxelBlock voxel_block(const GridShape& shape, const Leaf& leaf)
{
    return {leaf.corner * shape.voxels_per_leaf,
            shape.voxels_per_leaf << (shape.max_depth - leaf.level)};
}

bool is_in(const VoxelBlock& block, const Eigen::Vector3i& voxel)
{
    return (voxel.array() >= block.first.array()).all() &&
           (voxel.array() < block.first.array() + block.width).all();
}

MaterialTest material_test(const VoxelGrid& grid)
{
    return [&grid](const Leaf& leaf)
    {
        const VoxelBlock block = voxel_block(grid.shape(), leaf);
        for (int k = 0; k < block.width; ++k)
            for (int j = 0; j < block.width; ++j)
            {
                const std::uint8_t* row = &grid.material()[grid.index(
                    block.first.x(), block.first.y() + j, block.first.z() + k)];
                if (std::any_of(row, row + block.width,
                                [](std::uint8_t m) { return m != 0; }))
                    return true;
            }
        return false;
    };
}

} // namespace cellwarp::core
