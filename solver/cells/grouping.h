// SPDX-License-Identifier: GPL-3.0-or-later
// Groups of cells that hang together in a block of the octree, and groups of groups: what
// hierarchical solvers go up and down.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/cells.h"

namespace cellwarp::core
{

/// Where the leaf of a cell lies in the octree's lattice.
struct GridPlace
{
    Eigen::Vector3d box_centre; ///< from the lattice's corner
    double edge = 0.0;
};

GridPlace grid_place(const Cells& cells, int cell);
/// Of all cells.
std::vector<GridPlace> grid_places(const Cells& cells);

/// Neighbours in compressed rows.
struct Links
{
    std::vector<int> first; ///< nodes + 1
    std::vector<int> column;

    int count() const { return static_cast<int>(first.size()) - 1; }
    std::size_t begin(std::size_t node) const { return idx(first[node]); }
    std::size_t end(std::size_t node) const { return idx(first[node + 1]); }
};

/// Members of each group, ascending.
struct Members
{
    std::vector<int> first, node;

    Members() = default;
    Members(std::span<const int> group_of_node, int count);

    std::size_t size() const { return first.size() - 1; }
    std::span<const int> of(std::size_t group) const
    {
        return std::span(node).subspan(idx(first[group]),
                                       idx(first[group + 1] - first[group]));
    }
};

/// One level of groups, made from the nodes below it.
struct Grouping
{
    std::vector<int> group_of_node;
    Members members;
};

/// Octree boxes of the nodes of one level, smallest first: each call of join() groups the
/// nodes whose boxes have the smallest size into those of twice the edge. Nodes of larger
/// boxes wait, each a group of its own.
class OctreeBlocks
{
public:
    explicit OctreeBlocks(std::span<const GridPlace> places);

    /// Nodes of one block join if a chain of links leads from one to the other on which
    /// \p may_join(node, link) holds. Afterwards these are the blocks of the groups.
    Grouping join(const Links& links,
                  const std::function<bool(std::size_t, std::size_t)>& may_join);

    /// Whether the node's box is larger than those that the next call groups.
    bool is_waiting(std::size_t node) const { return size_[node] > level_; }
    /// Whether some boxes are still waiting.
    bool is_mixed() const;

private:
    bool is_one_block(std::size_t i, std::size_t j) const
    {
        return size_[i] == level_ && size_[j] == level_ && box_[i] == box_[j];
    }

    int level_ = 0;
    std::vector<Eigen::Vector3i> box_; ///< of the block that a node would join
    std::vector<int> size_;            ///< edges are 2^size
};

} // namespace cellwarp::core
