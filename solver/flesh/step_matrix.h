// SPDX-License-Identifier: GPL-3.0-or-later
// The matrix of an implicit step of flesh by its free nodes, for solvers with a factor.
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/flesh_forces.h"
#include "solver/flesh/lattice.h"
#include "solver/flesh/part_points.h"
#include "solver/linear/block_matrix.h"

namespace cellwarp::core
{

/// Z^T A Z: A is a sum over the parts, and Z has the nodes by the free ones.
class StepMatrix
{
public:
    /// \p by_free: Z, a row for each node of the lattice.
    StepMatrix(const Lattice& lattice, std::span<const FleshMaterial> materials,
               const SparseRows& by_free, std::size_t num_free);

    /// A is that of FleshForces::multiply(): with the frames or the second derivatives of
    /// its last follow().
    void assemble(const FleshForces& forces, const FleshFactors& factors);
    BlockMatrix& blocks() { return blocks_; }

private:
    struct Part
    {
        int cell;
        PartMatrix stiffness; ///< at rest
        Eigen::Matrix<double, 8, 8> mass;
        /// Free nodes that the corners take of, and how much each corner does.
        std::vector<int> free;
        std::vector<std::array<double, 8>> shares;
        /// The blocks of pairs of those, row by row; -1: above the diagonal.
        std::vector<int> blocks;
    };
    void add(const Part& part, const PartMatrix& A);

    std::vector<Part> parts_;
    BlockMatrix blocks_;
};

} // namespace cellwarp::core
