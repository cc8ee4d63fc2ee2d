// SPDX-License-Identifier: GPL-3.0-or-later
// Nodes of regions by their places: most samples of a region are nodes of it, and move
// with it whatever the field around them does.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace cellwarp
{

class NodeTable
{
public:
    struct Node
    {
        Eigen::Vector3d place;
        int cell = 0; ///< that holds it
        int region = 0;
    };

    NodeTable() = default;
    explicit NodeTable(std::vector<Node> nodes);

    /// The region of the node at a place, of several the first that was given; -1: there
    /// is none, or not all nodes at the place are of \p cell.
    int region_at(const Eigen::Vector3d& place, int cell) const;

private:
    std::size_t slot_of(const Eigen::Vector3d& place) const;

    std::vector<Node> nodes_;
    std::vector<std::uint32_t> slots_; ///< a power of two; of a node, or kEmpty
};

} // namespace cellwarp
