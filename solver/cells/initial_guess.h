// SPDX-License-Identifier: GPL-3.0-or-later
// A first guess of what the free cells do when regions move: each takes part in the
// regions' motions by how near they are through the glue.
#pragma once

#include <span>
#include <vector>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "solver/cells/constraints.h"
#include "solver/cells/glue.h"

namespace cellwarp
{

/// Shares of the regions in every cell, 1 in their own cells and harmonic through the
/// glue between them. Immutable.
class InitialGuess
{
public:
    /// \p region_of_cell: which region prescribes or pins a cell; -1: none.
    InitialGuess(const Cells& cells, const Glue& glue,
                 std::span<const Constraint> constraints,
                 std::span<const int> region_of_cell, int num_regions);

    /// Moves \p cells by the blend of the regions' steps: motions of space, from where
    /// they are. A cell whose regions all make one step makes it exactly.
    void carry(std::span<const Motion> steps, std::span<const int> cells,
               std::span<Pose> poses) const;

    /// The share of a region in a cell.
    double share(int cell, int region) const;

private:
    struct Share
    {
        int region = 0;
        float value = 0.0f;
    };
    std::vector<int> first_; ///< cells + 1 offsets into shares
    std::vector<Share> shares_;
};

} // namespace cellwarp
