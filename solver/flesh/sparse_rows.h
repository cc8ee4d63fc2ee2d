// SPDX-License-Identifier: GPL-3.0-or-later
// Rows of numbers of which most are zero: what one node takes from others.
#pragma once

#include <compare>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"

namespace cellwarp::core
{

/// A node and how much it counts.
struct NodeShare
{
    int node = 0;
    double share = 0.0;

    auto operator<=>(const NodeShare&) const = default;
};

using NodeShares = std::vector<NodeShare>;

/// Sums the shares of each node, in ascending order of the nodes, and leaves out those
/// that are zero.
NodeShares gathered(NodeShares shares);

/// Of a point that takes so much of its nodes: sum share x_node, x three numbers a node.
Eigen::Vector3d at_point(std::span<const NodeShare> shares, const Eigen::VectorXd& x);

/// Rows, one after the other in memory.
class SparseRows
{
public:
    void add(std::span<const NodeShare> row)
    {
        shares_.insert(shares_.end(), row.begin(), row.end());
        first_.push_back(shares_.size());
    }
    std::size_t size() const { return first_.size() - 1; }
    std::span<const NodeShare> operator[](std::size_t row) const
    {
        return std::span(shares_).subspan(first_[row], first_[row + 1] - first_[row]);
    }
    /// With \p columns rows: which rows take from each column, and how much.
    SparseRows transposed(std::size_t columns) const;

private:
    std::vector<std::size_t> first_ = {0};
    std::vector<NodeShare> shares_;
};

} // namespace cellwarp::core
