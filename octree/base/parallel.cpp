// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <stdexcept>
#include <system_error>

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include "octree/base/index.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

/// The number of times that a part of a loop looks at its scope, unless its grain is
/// larger than that share of it.
constexpr std::size_t kLooks = 64;

/// Calls \p body for [begin, end), in pieces between which \p scope is looked at.
void run_part(const ParallelBody& body, std::size_t begin, std::size_t end,
              std::size_t grain, const StopScope* scope)
{
    if (!scope)
        return body.call(body.body, begin, end);
    const StopScope::Entered entered(scope);
    const std::size_t piece = std::max(grain, (end - begin) / kLooks);
    for (; begin < end; begin += piece)
    {
        scope->check();
        body.call(body.body, begin, std::min(begin + piece, end));
    }
}

} // namespace

void run_parallel(std::size_t count, std::size_t grain, const ParallelBody& body)
{
    // What a part throws is carried home here: the library would take memory for that,
    // and end the program where there is none.
    tbb::task_group_context context;
    std::exception_ptr error;
    std::atomic_flag has_failed;
    const StopScope* const scope = StopScope::current();
    try
    {
        tbb::parallel_for(
            tbb::blocked_range<std::size_t>(0, count, grain),
            [&](const tbb::blocked_range<std::size_t>& range)
            {
                try
                {
                    run_part(body, range.begin(), range.end(), grain, scope);
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

} // namespace cellwarp::core
