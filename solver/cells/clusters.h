// SPDX-License-Identifier: GPL-3.0-or-later
// Overlapping groups of cells that are near each other through the glue. What is
// fitted or factored for each group alone stays small, and knows nothing of parts that
// only lie side by side.
#pragma once

#include <span>
#include <vector>

#include "octree/base/index.h"
#include "octree/cells.h"

namespace cellwarp::core
{

/// Lengths in cells, through faces: neighbours of one size are 1 apart.
struct ClusterSize
{
    int core = 3;         ///< edge of the block whose cells form the core
    double support = 2.0; ///< from the core: where the weight ends
    double reach = 3.0;   ///< from the core: cells of weight 0 are members up to here

    bool operator==(const ClusterSize&) const = default;
};

struct Cluster
{
    std::vector<int> core;  ///< connected through glue within the block; ascending
    std::vector<int> cells; ///< all members, ascending
};

/// How much a cell belongs to a cluster: (1 - d / support)^3, d its distance from the
/// core; 1 in the core.
struct Membership
{
    int cluster = 0;
    double weight = 0.0;
};

struct Clusters
{
    std::vector<Cluster> clusters;
    std::vector<int> first_membership; ///< cells + 1 offsets into memberships
    std::vector<Membership> memberships;

    /// Those of positive weight, ascending by cluster.
    std::span<const Membership> of_cell(int cell) const
    {
        const std::size_t first = idx(first_membership[idx(cell)]);
        const std::size_t end = idx(first_membership[idx(cell) + 1]);
        return std::span(memberships).subspan(first, end - first);
    }
};

/// Every cell is in one core. Blocks lie symmetrically in the box of the cells of one
/// size, so that a turned or mirrored shape has the turned or mirrored clusters.
/// \p is_left_out: one a cell; such cells are in no cluster.
Clusters grow_clusters(const Cells& cells, const std::vector<bool>& is_left_out,
                       const ClusterSize& size);

} // namespace cellwarp::core
