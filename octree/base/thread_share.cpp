// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/thread_share.h"

#include <exception>

#include <tbb/task_arena.h>

namespace cellwarp::core
{

void run_with_threads(int threads, void* body, void (*call)(void*))
{
    if (threads <= 0)
        return call(body);
    std::exception_ptr error; // the library would take memory to carry it
    tbb::task_arena arena(threads);
    arena.execute(
        [&]
        {
            try
            {
                call(body);
            }
            catch (...)
            {
                error = std::current_exception();
            }
        });
    if (error)
        std::rethrow_exception(error);
}

} // namespace cellwarp::core
