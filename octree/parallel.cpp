// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

namespace cellwarp
{

void run_parallel(std::size_t count, std::size_t grain, const ParallelBody& body)
{
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain),
                      [&](const tbb::blocked_range<std::size_t>& range)
                      { body.call(body.body, range.begin(), range.end()); });
}

struct ThreadLimit::Control
{
    tbb::global_control limit;
};

ThreadLimit::ThreadLimit(int threads)
{
    if (threads > 0)
        control_.reset(new Control{{tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads)}});
}

ThreadLimit::~ThreadLimit() = default;

} // namespace cellwarp
