// SPDX-License-Identifier: GPL-3.0-or-later
// CHOLMOD's supernodal L L^T. The simplicial L D L^T would call an indefinite
// matrix a success, and a NaN goes through either: values are checked before,
// status and diagonal after.
#include "solver/linear/cholesky.h"

#include <cmath>
#include <cstring>
#include <new>

#include <cholmod.h>

#include "octree/base/index.h"
#include "solver/linear/dense_kernels.h"

namespace cellwarp::core
{

struct SparseCholesky::Library
{
    // Mutable: solving uses the library's workspace.
    mutable cholmod_common common;
    cholmod_factor* factor = nullptr;
    mutable cholmod_dense *solution = nullptr, *work_y = nullptr, *work_e = nullptr;

    Library() { cholmod_start(&common); }
    ~Library()
    {
        for (cholmod_dense** dense : {&solution, &work_y, &work_e})
            cholmod_free_dense(dense, &common);
        cholmod_free_factor(&factor, &common);
        cholmod_finish(&common);
    }
};

namespace
{

void throw_if_out_of_memory(const cholmod_common& common)
{
    if (common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE)
        throw std::bad_alloc();
}

/// The matrix as the library sees it; shares the values, which it does not change.
cholmod_sparse view(const BlockMatrix& A)
{
    cholmod_sparse view;
    std::memset(&view, 0, sizeof view);
    view.nrow = view.ncol = idx(A.rows());
    view.nzmax = A.values().size();
    view.p = const_cast<std::int32_t*>(A.column_starts().data());
    view.i = const_cast<std::int32_t*>(A.row_indices().data());
    view.x = const_cast<double*>(A.values().data());
    view.stype = -1;
    view.itype = CHOLMOD_INT;
    view.xtype = CHOLMOD_REAL;
    view.dtype = CHOLMOD_DOUBLE;
    view.sorted = 1;
    view.packed = 1;
    return view;
}

} // namespace

SparseCholesky::SparseCholesky(const BlockMatrix& A)
    : library_(std::make_unique<Library>())
{
    const OneDenseThread one_thread;
    cholmod_common& common = library_->common;
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.final_ll = 1;
    cholmod_sparse matrix = view(A);
    library_->factor = cholmod_analyze(&matrix, &common);
    throw_if_out_of_memory(common);
}

SparseCholesky::~SparseCholesky() = default;
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;

bool SparseCholesky::factorize(const BlockMatrix& A)
{
    const Eigen::Map<const Eigen::VectorXd> values(
        A.values().data(), static_cast<Eigen::Index>(A.values().size()));
    if (!library_->factor || !values.allFinite())
        return false;
    const OneDenseThread one_thread;
    cholmod_sparse matrix = view(A);
    cholmod_common& common = library_->common;
    const bool is_done = cholmod_factorize(&matrix, library_->factor, &common) != 0;
    throw_if_out_of_memory(common);
    if (!is_done || common.status != CHOLMOD_OK ||
        library_->factor->minor != library_->factor->n)
        return false;
    return std::isfinite(cholmod_rcond(library_->factor, &common));
}

void SparseCholesky::solve(const Eigen::VectorXd& b, Eigen::VectorXd& x) const
{
    const OneDenseThread one_thread;
    cholmod_dense right;
    std::memset(&right, 0, sizeof right);
    right.nrow = right.d = right.nzmax = idx(b.size());
    right.ncol = 1;
    right.x = const_cast<double*>(b.data());
    right.xtype = CHOLMOD_REAL;
    right.dtype = CHOLMOD_DOUBLE;
    cholmod_solve2(CHOLMOD_A, library_->factor, &right, nullptr, &library_->solution,
                   nullptr, &library_->work_y, &library_->work_e, &library_->common);
    throw_if_out_of_memory(library_->common);
    x = Eigen::Map<const Eigen::VectorXd>(
        static_cast<const double*>(library_->solution->x), b.size());
}

double SparseCholesky::factor_numbers() const
{
    return library_->common.lnz;
}

} // namespace cellwarp::core
