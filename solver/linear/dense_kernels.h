// SPDX-License-Identifier: GPL-3.0-or-later
// The threads of the dense kernels (BLAS) under the sparse library and LAPACK. At the
// sizes here one is faster than several, and their sums depend on the count.
#pragma once

namespace cellwarp::core
{

/// While it lives, the dense kernels work on the thread that calls them alone; when the
/// last one goes, the process has the count of threads that it had before.
class OneDenseThread
{
public:
    /// Also takes the buffer that the kernels work in: without memory for it they would
    /// wait for ever. Throws std::bad_alloc.
    OneDenseThread();
    ~OneDenseThread();
    OneDenseThread(const OneDenseThread&) = delete;
    OneDenseThread& operator=(const OneDenseThread&) = delete;

private:
    int num_threads_, num_levels_; ///< of OpenMP, for this thread
};

/// Ends the threads of the dense kernels for the whole process and for good: for the
/// beginning of main(), not for a library. They are started with the program, and look
/// for work without rest for its first 25 ms, on the cores that it wants. Does its work
/// once.
void end_dense_threads();

} // namespace cellwarp::core
