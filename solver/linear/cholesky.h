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

/// Ends the threads of the dense kernels and sets their number to one: at the sizes here
/// more are slower, and their sums depend on the count. They are started with the
/// program, and look for work without rest for its first 25 ms, on the cores that it
/// wants: so it is for the beginning of main(). Does its work once.
void end_dense_threads();

/// To be called before the first dense kernel; does its work once. Ends their threads,
/// and takes the buffer that they work in: without memory for it they would wait for
/// ever. Throws std::bad_alloc.
void prepare_dense_kernels();

} // namespace cellwarp::core
