// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/level_preconditioner.h"

#include <Eigen/SparseCore>

#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

using Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;
using Entry = Eigen::Triplet<double>;

constexpr std::size_t kLevelGrain = 2048; ///< nodes

Sparse matrix_of(const SparseRows& rows, std::size_t columns)
{
    std::vector<Entry> entries;
    for (std::size_t row = 0; row < rows.size(); ++row)
        for (const NodeShare& share : rows[row])
            entries.emplace_back(static_cast<int>(row), share.node, share.share);
    Sparse out(Eigen::Index(rows.size()), Eigen::Index(columns));
    out.setFromTriplets(entries.begin(), entries.end());
    return out;
}

/// One number a pair of free nodes.
Sparse mean_matrix(const Lattice& lattice, const BoundNodes& nodes,
                   std::span<const Eigen::Matrix<double, 8, 8>> blocks)
{
    const Sparse W = matrix_of(by_free_of_all(nodes), nodes.free.size());
    std::vector<Entry> entries;
    entries.reserve(64 * blocks.size());
    for (std::size_t p = 0; p < blocks.size(); ++p)
    {
        const CornerNodes& corners = lattice.cells[idx(lattice.parts[p].cell)];
        for (int a = 0; a < 8; ++a)
            for (int b = 0; b < 8; ++b)
                entries.emplace_back(corners[idx(a)], corners[idx(b)], blocks[p](a, b));
    }
    Sparse S(W.rows(), W.rows());
    S.setFromTriplets(entries.begin(), entries.end());
    return W.transpose() * (S * W).pruned();
}

VectorXd inverted(const VectorXd& diagonal)
{
    return diagonal.unaryExpr([](double d) { return d > 0.0 ? 1.0 / d : 0.0; });
}

/// out (+)= rows x, three numbers a node.
void multiply(const SparseRows& rows, const VectorXd& x, bool adds, VectorXd& out)
{
    out.resize(Eigen::Index(3 * rows.size()));
    parallel_for(rows.size(), kLevelGrain,
                 [&](std::size_t row)
                 {
                     double* const sum = out.data() + 3 * row;
                     if (!adds)
                         sum[0] = sum[1] = sum[2] = 0.0;
                     for (const NodeShare& share : rows[row])
                     {
                         const double* const of = x.data() + 3 * share.node;
                         for (int c = 0; c < 3; ++c)
                             sum[c] += share.share * of[c];
                     }
                 });
}

} // namespace

LevelPreconditioner::LevelPreconditioner(
    const Lattice& lattice, const BoundNodes& nodes,
    std::span<const Eigen::Matrix<double, 8, 8>> blocks, bool has_levels)
{
    Sparse A = mean_matrix(lattice, nodes, blocks);
    levels_.emplace_back().inverse = inverted(A.diagonal());
    if (!has_levels)
        return;
    for (const Lattice::Coarser& coarser : lattice.coarser)
    {
        Level& level = levels_.emplace_back();
        if (levels_.size() == 2)
            for (const int node : nodes.free)
                level.down.add(coarser.below[idx(node)]);
        else
            level.down = coarser.below;
        level.up = level.down.transposed(coarser.num_nodes);
        const Sparse P = matrix_of(level.down, coarser.num_nodes);
        A = P.transpose() * Sparse(A * P);
        level.inverse = inverted(A.diagonal());
    }
}

void LevelPreconditioner::apply(const VectorXd& r, VectorXd& z)
{
    const auto scaled = [](const VectorXd& inverse, const VectorXd& in, VectorXd& out)
    {
        out.resize(in.size());
        for (Eigen::Index n = 0; n < inverse.size(); ++n)
            for (Eigen::Index c = 0; c < 3; ++c)
                out[3 * n + c] = inverse[n] * in[3 * n + c];
    };
    scaled(levels_.front().inverse, r, z);
    for (std::size_t l = 1; l < levels_.size(); ++l)
    {
        Level& level = levels_[l];
        multiply(level.up, l == 1 ? r : levels_[l - 1].r, false, level.r);
        scaled(level.inverse, level.r, level.z);
    }
    for (std::size_t l = levels_.size() - 1; l >= 1; --l)
        multiply(levels_[l].down, levels_[l].z, true, l == 1 ? z : levels_[l - 1].z);
}

} // namespace cellwarp::core
