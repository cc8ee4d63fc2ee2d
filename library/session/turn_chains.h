// SPDX-License-Identifier: GPL-3.0-or-later
// How far the material is wound between regions. Two solutions whose regions are in the
// same places may differ by whole turns, and only the way from one region to another
// through the cells tells.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"

namespace cellwarp::core
{

/// Immutable. Of each connected part, chains of glued cells from one of its regions to
/// each other one.
class TurnChains
{
public:
    /// \p region_of_cell: -1 where there is none.
    TurnChains(const Cells& cells, std::span<const int> region_of_cell);

    /// Of each chain, in columns, the turns from cell to cell, added as rotation vectors
    /// [rad].
    Eigen::Matrix3Xd turns(std::span<const Pose> poses) const;

private:
    std::vector<std::vector<int>> chains_;
};

} // namespace cellwarp::core
