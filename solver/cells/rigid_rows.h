// SPDX-License-Identifier: GPL-3.0-or-later
// The matrix of a level of rigid bodies while it is built, in double precision.
// rigid_multigrid.cpp tells what the levels are.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/rigid_motion.h"
#include "solver/cells/cell_state.h"
#include "solver/cells/grouping.h"
#include "solver/linear/linear_operator.h"

namespace cellwarp
{

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Rows of blocks, diagonal included, scaled to a mean diagonal of 1, angular and linear
/// apart.
struct RigidRows : Links
{
    std::vector<Matrix6> block;
    std::vector<Vector6> scale; ///< of each row: the true unknowns are scale times these

    std::size_t diagonal(std::size_t row) const
    {
        std::size_t k = begin(row);
        while (column[k] != static_cast<int>(row))
            ++k;
        return k;
    }
};

/// The bodies of a level.
struct RigidBodies
{
    std::vector<Eigen::Vector3d> centre;
    /// Onto the directions in which it shifts: all; none of what turns about a point and
    /// does nothing else; one of what slides along a curve.
    std::vector<Eigen::Matrix3d> shift;

    bool is_free(std::size_t body) const { return shift[body].isIdentity(0); }
};

/// The rows of the finest level, in common axes; a place a block. A block of 3 gets three
/// more unknowns that do nothing, one of 4 two.
RigidRows rows_of(const BlockOperator& matrix, std::span<const BlockPlace> places);

/// A body of each group, about the mean of its members' centres.
RigidBodies joined_bodies(const RigidBodies& bodies, const Members& members);

/// A_C of all bodies. Of the next bodies it finds how they shift.
RigidRows joined_rows(const RigidRows& A, const RigidBodies& bodies,
                      const Grouping& grouping, RigidBodies& next_bodies);

/// Loops over few bodies are not worth a second thread.
template <class Body>
void for_each_body(int count, Body&& body)
{
    constexpr std::size_t kGrain = 128;
    parallel_for(idx(count), kGrain, body);
}

} // namespace cellwarp
