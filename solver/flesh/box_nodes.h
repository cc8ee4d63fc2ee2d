// SPDX-License-Identifier: GPL-3.0-or-later
// The nodes of boxes of an octree: their corners, of which those that glue holds together
// are one node.
#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/sparse_rows.h"

namespace cellwarp::core
{

/// In whole numbers, as Leaf has it.
struct LatticeBox
{
    Eigen::Vector3i corner = Eigen::Vector3i::Zero();
    int width = 1;

    bool operator==(const LatticeBox& other) const
    {
        return corner == other.corner && width == other.width;
    }
};

/// Corner k of a box lies at its first corner plus its width along axis i for each bit i
/// of k.
using CornerNodes = std::array<int, 8>;

Eigen::Vector3i corner_of(const LatticeBox& box, int k);
/// In [0, 1] along each axis, if it is inside.
Eigen::Vector3d place_in(const LatticeBox& box, const Eigen::Vector3i& place);

/// Shares of the corners at a point of a box, in [0, 1] along each axis: trilinear.
std::array<double, 8> corner_shares(const Eigen::Vector3d& local);

/// Corners of boxes that hold two parts of the material which do not touch are two nodes,
/// however near they are: fingers do not stick. [Molino04]
/// A node that lies on the side of a larger box, and is no corner of it, hangs: it goes
/// where the corners of that box have it, so that nothing gapes.
struct BoxNodes
{
    std::vector<CornerNodes> of_box;
    std::vector<Eigen::Vector3i> places; ///< of the nodes
    /// What a node that hangs takes of those that do not; empty for those.
    std::vector<NodeShares> hanging;
};

/// What a point of a box takes of the nodes that do not hang. \p local: in [0, 1] along
/// each axis, if it is inside; \p hanging: as BoxNodes has it.
NodeShares shares_of(const CornerNodes& corners, std::span<const NodeShares> hanging,
                     const Eigen::Vector3d& local);

/// \p glued: pairs of boxes whose material is joined.
BoxNodes box_nodes(std::span<const LatticeBox> boxes,
                   std::span<const std::pair<int, int>> glued);

/// The largest box on whose side a node lies without being its corner, and where.
struct NodeHost
{
    int box = -1; ///< negative: the node does not hang
    Eigen::Vector3d local = Eigen::Vector3d::Zero();
};
/// Shares that \p nodes take where they hang. \p hosts: of each node.
void hang_nodes(std::span<const LatticeBox> boxes, std::span<const NodeHost> hosts,
                BoxNodes& nodes);

/// Shares that nodes take of those of larger boxes; none where they hang. \p boxes: of
/// \p coarse; \p group: of each box of \p fine the one of these that it lies in.
SparseRows rows_between(const BoxNodes& fine, std::span<const LatticeBox> boxes,
                        const BoxNodes& coarse, std::span<const int> group);

} // namespace cellwarp::core
