// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/linear/dense_kernels.h"

#include <cstddef>
#include <mutex>
#include <new>

#include <sys/mman.h>

extern "C" int openblas_get_num_threads();
extern "C" void openblas_set_num_threads(int);
// Weak: not every build of the library has threads, or ends them by this name.
extern "C" int blas_thread_shutdown_() __attribute__((weak));
extern "C" int omp_get_max_threads();
extern "C" void omp_set_num_threads(int);
extern "C" int omp_get_max_active_levels();
extern "C" void omp_set_max_active_levels(int);
extern "C" void dpotrf_(const char*, const int*, double*, const int*, int*);

namespace cellwarp::core
{

namespace
{

/// Memory that the dense kernels take at their first call, with a margin [byte].
constexpr std::size_t kBlasBuffer = std::size_t(160) << 20;

bool take_buffer()
{
    void* const room = ::mmap(nullptr, kBlasBuffer, PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (room == MAP_FAILED)
        throw std::bad_alloc();
    ::munmap(room, kBlasBuffer);
    const int one = 1;
    int info = 0;
    double number = 1.0;
    dpotrf_("L", &one, &number, &one, &info);
    return true;
}

/// The count of threads is one for the whole process: scopes of several threads share it.
std::mutex mutex;
int num_scopes = 0, num_before = 1;

} // namespace

OneDenseThread::OneDenseThread()
    : num_threads_(omp_get_max_threads()), num_levels_(omp_get_max_active_levels())
{
    const std::lock_guard lock(mutex);
    static const bool has_buffer = take_buffer();
    static_cast<void>(has_buffer);
    if (num_scopes++ == 0)
        num_before = openblas_get_num_threads();
    // To set one again would start ended threads again.
    if (openblas_get_num_threads() != 1)
        openblas_set_num_threads(1);
    // The sparse library's own threads, and those of a BLAS that is built with OpenMP.
    omp_set_num_threads(1);
    omp_set_max_active_levels(0);
}

OneDenseThread::~OneDenseThread()
{
    const std::lock_guard lock(mutex);
    if (--num_scopes == 0 && num_before != 1)
        openblas_set_num_threads(num_before);
    omp_set_num_threads(num_threads_);
    omp_set_max_active_levels(num_levels_);
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

} // namespace cellwarp::core
