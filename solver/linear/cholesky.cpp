// SPDX-License-Identifier: GPL-3.0-or-later
// CHOLMOD's supernodal L L^T. The simplicial L D L^T would call an indefinite
// matrix a success, and a NaN goes through either: values are checked before,
// status and diagonal after.
#include "solver/linear/cholesky.h"

#include <cmath>
#include <cstring>
#include <mutex>
#include <new>

#include <sys/mman.h>

#include <cholmod.h>

#include "octree/base/index.h"

extern "C" void openblas_set_num_threads(int);
// Weak: not every build of the library has threads, or ends them by this name.
extern "C" int blas_thread_shutdown_() __attribute__((weak));
extern "C" void omp_set_max_active_levels(int);
extern "C" void dpotrf_(const char*, const int*, double*, const int*, int*);

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

/// What the dense kernels take at their first call, with a margin [byte].
constexpr std::size_t kBlasBuffer = std::size_t(160) << 20;

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
    prepare_dense_kernels();
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

void end_dense_threads()
{
    // Once: to set their number again would start them again.
    static const bool is_done = []
    {
        openblas_set_num_threads(1);
        if (blas_thread_shutdown_)
            blas_thread_shutdown_();
        return true;
    }();
    static_cast<void>(is_done);
}

void prepare_dense_kernels()
{
    static std::mutex mutex;
    static bool is_prepared = false;
    const std::lock_guard lock(mutex);
    if (is_prepared)
        return;
    end_dense_threads();
    omp_set_max_active_levels(0); // no threads of its own for the sparse library
    void* const room = ::mmap(nullptr, kBlasBuffer, PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (room == MAP_FAILED)
        throw std::bad_alloc();
    ::munmap(room, kBlasBuffer);
    const int one = 1;
    int info = 0;
    double number = 1.0;
    dpotrf_("L", &one, &number, &one, &info);
    is_prepared = true;
}

} // namespace cellwarp::core
