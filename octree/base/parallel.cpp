// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/parallel.h"

#include <atomic>
#include <exception>
#include <stdexcept>
#include <system_error>

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include "octree/base/index.h"

namespace cellwarp
{

void run_parallel(std::size_t count, std::size_t grain, const ParallelBody& body)
{
    // What a part throws is carried home here: the library would take memory for that,
    // and end the program where there is none.
    tbb::task_group_context context;
    std::exception_ptr error;
    std::atomic_flag has_failed;
    try
    {
        tbb::parallel_for(
            tbb::blocked_range<std::size_t>(0, count, grain),
            [&](const tbb::blocked_range<std::size_t>& range)
            {
                try
                {
                    body.call(body.body, range.begin(), range.end());
                }
                catch (...)
                {
                    if (!has_failed.test_and_set())
                        error = std::current_exception();
                    context.cancel_group_execution();
                }
            },
            context);
    }
    catch (const std::runtime_error&)
    {
        // Not a part's, but the library's own: it could not begin a thread.
        throw std::system_error(
            std::make_error_code(std::errc::resource_unavailable_try_again));
    }
    if (error)
        std::rethrow_exception(error);
}

struct ThreadLimit::Control
{
    tbb::global_control limit;
};

ThreadLimit::ThreadLimit(int threads)
{
    if (threads > 0)
        control_.reset(
            new Control{{tbb::global_control::max_allowed_parallelism, idx(threads)}});
}

ThreadLimit::~ThreadLimit()
{
    // Where the library had no memory it may still hold the lock that an end of the limit
    // waits for. Whoever throws out of here ends the program: the limit may stay.
    static std::atomic<Control*> left_behind;
    if (std::uncaught_exceptions() > 0)
        left_behind = control_.release();
}

} // namespace cellwarp
