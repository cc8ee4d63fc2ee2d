// SPDX-License-Identifier: GPL-3.0-or-later
// The adaptive octree: boxes that hold material, from the coarsest grid down.
// Boxes without material are left out. What lies inside a leaf is not its business.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// An undivided box. Its corner and width are in units of the finest leaves.
struct Leaf
{
    Eigen::Vector3i corner = Eigen::Vector3i::Zero();
    int level = 0; ///< 0 for the coarsest grid

    bool operator==(const Leaf& other) const
    {
        return corner == other.corner && level == other.level;
    }
};

/// The number of a leaf among those of an octree.
enum class LeafNumber : int
{
    None = -1
};

/// Whether a box holds material. Must be true of a box if it is of a part of it.
using MaterialTest = std::function<bool(const Leaf&)>;

/// Immutable: splitting and merging give a new octree. Leaves are in Morton order,
/// and face neighbours differ by at most one level (2:1 balance).
class Octree
{
public:
    /// The coarsest grid of \p shape.
    Octree(const GridShape& shape, const MaterialTest& has_material);

    const std::vector<Leaf>& leaves() const { return leaves_; }
    int max_depth() const { return max_depth_; }
    int width(const Leaf& leaf) const { return 1 << (max_depth_ - leaf.level); }
    const Leaf& operator[](LeafNumber leaf) const { return leaves_[idx(leaf)]; }
    auto numbers() const { return numbers_below<LeafNumber>(leaves_.size()); }
    /// The leaf that holds a finest box; None if there is no material.
    LeafNumber find(const Eigen::Vector3i& finest) const;

    /// Splits these leaves, and as many others as balance demands. Leaves at the
    /// deepest level stay.
    Octree split(std::span<const LeafNumber> leaves,
                 const MaterialTest& has_material) const;
    /// Every leaf down to \p level.
    Octree split_all(int level, const MaterialTest& has_material) const;
    /// Puts the siblings of each of these leaves back into their parent, where all
    /// of them are leaves and balance allows it.
    Octree merge(std::span<const LeafNumber> leaves) const;
    /// Every leaf with its siblings in their parent, where that lies inside the grid and
    /// balance allows it; levels below 0 are above the coarsest grid.
    Octree merge_all() const;

    /// Of each leaf its number in another octree of the same grid; None where that has
    /// none such.
    std::vector<LeafNumber> numbers_in(const Octree& other) const;

    /// The leaves of every box whose parts are all undivided, ascending.
    std::vector<std::vector<LeafNumber>> siblings() const;

    bool is_balanced() const;

private:
    Octree(std::vector<Leaf> leaves, const Eigen::Vector3i& counts, int max_depth);

    std::uint64_t key(const Leaf& leaf) const;
    void sort();
    Leaf parent(const Leaf& leaf) const;
    bool is_inside(const Leaf& leaf, const Leaf& box) const;
    Octree merge_into(std::vector<Leaf> boxes) const;
    /// Leaves that touch a face of \p box from outside.
    std::vector<LeafNumber> face_neighbours(const Leaf& box) const;
    std::vector<LeafNumber> unbalanced() const;

    std::vector<Leaf> leaves_;
    std::vector<std::uint64_t> keys_;
    Eigen::Vector3i counts_; ///< finest leaves on each axis
    int max_depth_ = 0;
};

/// Whether any voxel of a box is material.
MaterialTest material_test(const VoxelGrid& grid);

/// First voxel of a box, and voxels along its edge.
struct VoxelBlock
{
    Eigen::Vector3i first;
    int width;
};
VoxelBlock voxel_block(const GridShape& shape, const Leaf& leaf);
bool is_in(const VoxelBlock& block, const Eigen::Vector3i& voxel);

} // namespace cellwarp::core
