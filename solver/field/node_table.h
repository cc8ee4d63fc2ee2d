// SPDX-License-Identifier: GPL-3.0-or-later
// Nodes of regions by their places: most samples of a region are nodes of it, and move
// with it whatever the field around them does.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// Nodes by their places, to the bit. Immutable.
class NodeTable
{
public:
    /// In place of a cell: a node that is not found, nor any other one at its place.
    static constexpr int kNotFound = -1;

    struct Node
    {
        const Eigen::Vector3d* place; ///< outlives the table
        int cell = 0;                 ///< that holds it, or kNotFound
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
    /// A power of two of them: the number of a node, or none.
    std::vector<std::uint32_t> slots_;
};

} // namespace cellwarp::core
