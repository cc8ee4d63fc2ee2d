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

namespace cellwarp::core
{

/// Whose motion a cell takes that is not free: that of a region, or what lies between two
/// places of a rod. From the number of a region: of that alone; -1: free.
struct Driving
{
    // Implicit: most cells follow one region.
    Driving(int motion = -1) : first(motion) {}
    Driving(int from, int to, double of_to) : first(from), second(to), share(of_to) {}

    int first = -1, second = -1; ///< motions
    double share = 0.0;          ///< of the second

    bool is_free() const { return first < 0; }
    double share_of(int motion) const
    {
        return (motion == first ? 1.0 - share : 0.0) + (motion == second ? share : 0.0);
    }
};

/// Shares of the motions in every cell, given where cells are driven and harmonic through
/// the glue between them. Immutable.
class InitialGuess
{
public:
    /// \p driving: of the cells that something prescribes or pins.
    InitialGuess(const Cells& cells, const Glue& glue,
                 std::span<const Constraint> constraints,
                 std::span<const Driving> driving, int num_motions);

    /// Moves \p cells by the blend of the steps of the motions: motions of space, from
    /// where they are. A cell whose motions all make one step makes it exactly.
    void carry(std::span<const Motion> steps, std::span<const int> cells,
               std::span<Pose> poses) const;

    /// The share of a motion in a cell.
    double share(int cell, int motion) const;

private:
    struct Share
    {
        int motion = 0;
        float value = 0.0f;
    };
    std::vector<int> first_; ///< cells + 1 offsets into shares
    std::vector<Share> shares_;
};

} // namespace cellwarp::core
