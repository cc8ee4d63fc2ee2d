// SPDX-License-Identifier: GPL-3.0-or-later
// Sparse Cholesky. The only file behind it is cholesky.cpp; nothing else
// knows the library.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "solver/linear/block_matrix.h"

namespace cellwarp::core
{

/// Keeps the ordering and symbolic factor of one sparsity structure; factorize()
/// may be called for any values in it.
class SparseCholesky
{
public:
    /// Analyses the structure of \p A. Throws std::bad_alloc.
    explicit SparseCholesky(const BlockMatrix& A);
    ~SparseCholesky();
    SparseCholesky(SparseCholesky&&) noexcept;
    SparseCholesky& operator=(SparseCholesky&&) noexcept;

    /// False if \p A is not finite or not positive definite. Throws std::bad_alloc.
    /// \pre \p A has the structure that was analysed.
    [[nodiscard]] bool factorize(const BlockMatrix& A);

    /// Solves A x = b. Keeps its workspace: nothing is allocated from the second call on.
    /// \pre the last factorize() returned true.
    void solve(const Eigen::VectorXd& b, Eigen::VectorXd& x) const;

    /// Numbers in the factor, known from the analysis: memory is 8 bytes each.
    double factor_numbers() const;

private:
    struct Library;
    std::unique_ptr<Library> library_;
};

} // namespace cellwarp::core
