// SPDX-License-Identifier: GPL-3.0-or-later
// A preconditioner for cells of any number: ever larger groups of glued cells, moved as
// rigid bodies. [Botsch07] names a hierarchical solver on the octree as future work; this
// is one. rigid_multigrid.cpp tells how.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/cells/unknown_body.h"
#include "solver/linear/linear_operator.h"

namespace cellwarp::core
{

/// One V-cycle, in single precision. Time and memory are linear in the cells. Nothing is
/// allocated after construction. The result does not depend on the number of threads.
class RigidMultigrid final : public Preconditioner
{
public:
    /// \p matrix: second derivatives as linearised, best by kGaussNewton. \p bodies: all
    /// unknowns, ascending.
    RigidMultigrid(const BlockOperator& matrix, std::span<const UnknownBody> bodies);
    ~RigidMultigrid() override;
    RigidMultigrid(RigidMultigrid&&) noexcept;
    RigidMultigrid& operator=(RigidMultigrid&&) noexcept;

    void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) override;

    /// Cells, then groups of each coarser level.
    std::vector<int> sizes() const;
    double bytes() const;
    /// Memory for so many cells and faces [byte], at most, while it is built; without
    /// that of rods. \p is_flat: the cells stay in a plane.
    static double memory_estimate(std::size_t cells, std::size_t faces,
                                  bool is_flat = false);

private:
    struct Levels;
    std::unique_ptr<Levels> levels_;
};

} // namespace cellwarp::core
