// SPDX-License-Identifier: GPL-3.0-or-later
// Distances between sets of voxels, from middle to middle, exact in whole numbers: what
// is equally near is so to the bit.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// A tree of boxes over a copy of some voxels. Immutable, safe for many threads.
class VoxelTree
{
public:
    /// \pre \p voxels is not empty, and has none twice.
    explicit VoxelTree(std::vector<Eigen::Vector3i> voxels);

    /// In the order of the tree.
    const std::vector<Eigen::Vector3i>& voxels() const { return voxels_; }
    /// The least squared distance of the boxes around all voxels.
    std::int64_t least_between_boxes(const VoxelTree& other) const;
    /// The least squared distance to a voxel of \p other, or \p most where that is less.
    std::int64_t nearest(const VoxelTree& other, std::int64_t most) const;
    /// Those at the least squared distance from \p voxel, which it returns, unless that
    /// is more than \p most: then none, and \p most + 1. In the order of the tree.
    /// Replaces \p out.
    std::int64_t nearest(const Eigen::Vector3i& voxel, std::int64_t most,
                         std::vector<Eigen::Vector3i>& out) const;

private:
    struct Node
    {
        Eigen::Vector3i low, high;  ///< first and last voxel on each axis
        int begin = 0, end = 0;     ///< of its voxels
        int lower = -1, upper = -1; ///< nodes below it; -1: it has none
    };

    int build(int begin, int end);
    void search(const VoxelTree& other, int own, int of_other, std::int64_t& best) const;
    void search(const Eigen::Vector3i& voxel, int node, std::int64_t& best,
                std::vector<Eigen::Vector3i>& out) const;

    std::vector<Eigen::Vector3i> voxels_;
    std::vector<Node> nodes_; ///< the first one holds all
};

} // namespace cellwarp::core
