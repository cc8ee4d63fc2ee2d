// SPDX-License-Identifier: GPL-3.0-or-later
// The matrix of a level of rigid bodies while it is built, in double precision.
// rigid_multigrid.cpp tells what the levels are.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/cells/glue_block.h"
#include "solver/cells/grouping.h"
#include "solver/cells/unknown_body.h"
#include "solver/linear/linear_operator.h"

namespace cellwarp::core
{

/// Rows of blocks, diagonal included, scaled to a mean diagonal of 1, angular and linear
/// apart.
struct RigidRows : Links
{
    std::vector<GlueBlock> glue;
    /// What blocks are beside their glue, where something else couples two bodies or one
    /// of them is held; mostly null.
    std::vector<std::unique_ptr<Matrix6>> rest;
    std::vector<Vector6> scale; ///< of each row: the true unknowns are scale times these

    /// For the columns that are known by now: glue is not set, and there is no rest.
    void make_blocks();
    /// Its glue and its rest.
    Matrix6 block(std::size_t at) const;
    void set_block(std::size_t at, const Matrix6& block);
    /// \pre the block's glue is set
    void add_block(std::size_t at, const Matrix6& block);
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
    std::vector<char> is_on_rod; ///< a member is; see UnknownBody
    /// Which of the projections below is its own; -1: its members can make all motions,
    /// as where a free cell is one.
    std::vector<int> limit;
    /// Onto the motions that can be made, turns before shifts: turns of what is held at a
    /// point and does nothing else.
    std::vector<Matrix6> limits;

    bool is_free(std::size_t body) const { return limit[body] < 0; }
    Matrix6& own_limit(std::size_t body) { return limits[idx(limit[body])]; }
    const Matrix6& own_limit(std::size_t body) const { return limits[idx(limit[body])]; }
    void add(const Eigen::Vector3d& at, bool is_rod, bool is_limited)
    {
        centre.push_back(at);
        is_on_rod.push_back(is_rod);
        limit.push_back(is_limited ? static_cast<int>(limits.size()) : -1);
        if (is_limited)
            limits.push_back(Matrix6::Zero());
    }
};

/// Of the finest level.
RigidBodies finest_bodies(std::span<const UnknownBody> bodies);

/// The rows of the finest level, in common axes. Unknowns that a body has not, and those
/// that do nothing, do not depend on others there.
RigidRows rows_of(const BlockOperator& matrix, std::span<const UnknownBody> bodies);

/// A body of each group, about the mean of its members' centres.
RigidBodies joined_bodies(const RigidBodies& bodies, const Members& members);

/// A_C of all bodies. Of the next bodies it finds what motions they make.
RigidRows joined_rows(const RigidRows& A, const RigidBodies& bodies,
                      const Grouping& grouping, RigidBodies& next_bodies);

/// Loops over few bodies are not worth a second thread.
template <class Body>
void for_each_body(int count, Body&& body)
{
    constexpr std::size_t kGrain = 128;
    parallel_for(idx(count), kGrain, body);
}

} // namespace cellwarp::core
