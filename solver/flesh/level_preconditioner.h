// SPDX-License-Identifier: GPL-3.0-or-later
// Preconditioner of implicit steps: the sum over ever coarser lattices of what each
// makes of the residual by the diagonal of its own matrix. [BPX90]
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/bound_nodes.h"
#include "solver/flesh/lattice.h"
#include "solver/linear/linear_operator.h"

namespace cellwarp::core
{

/// B = sum_l I_l D_l^-1 I_l^T, with I_l from the nodes of level l to the free nodes of
/// the lattice, and D_l the diagonal of I_l^T A I_l. One number a node stands for its
/// three axes, so that no turn of a frame changes it: it is made once.
class LevelPreconditioner : public Preconditioner
{
public:
    /// \p blocks: of A, see FleshForces::mean_blocks(). \p has_levels: without, the
    /// lattice's own diagonal alone (Jacobi).
    LevelPreconditioner(const Lattice& lattice, const BoundNodes& nodes,
                        std::span<const Eigen::Matrix<double, 8, 8>> blocks,
                        bool has_levels);

    /// Vectors have three numbers for each free node.
    void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) override;
    std::size_t num_levels() const { return levels_.size(); }
    /// The inverse of the diagonal of A, of each free node.
    const Eigen::VectorXd& scale() const { return levels_.front().inverse; }

private:
    struct Level
    {
        Eigen::VectorXd inverse; ///< of the diagonal; 0 where it is 0
        /// What nodes of the level below take of this one's, and transposed; empty at the
        /// free nodes.
        SparseRows down, up;
        Eigen::VectorXd r, z; ///< scratch
    };
    std::vector<Level> levels_;
};

} // namespace cellwarp::core
