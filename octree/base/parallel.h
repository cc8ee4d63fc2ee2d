// SPDX-License-Identifier: GPL-3.0-or-later
// Loops on all threads. Every loop of the program comes through here: who writes what
// is the same for every number of threads, so the results are the same to the bit.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

#ifdef CELLWARP_SANITIZED_THREAD
extern "C" void __tsan_acquire(void*);
extern "C" void __tsan_release(void*);
#endif

namespace cellwarp::core
{

/// A loop body seen through a pointer, so that no template carries the library.
struct ParallelBody
{
    void* body;
    void (*call)(void* body, std::size_t begin, std::size_t end);
};

/// Calls \p body for parts of [0, count), on all threads, until all are done; \p grain
/// and less is not split. Throws what a part throws, Stopped (stop_scope.h), EAGAIN: no
/// thread.
void run_parallel(std::size_t count, std::size_t grain, const ParallelBody& body);

/// Calls body(begin, end) as run_parallel() does: for loops that keep something from
/// one step to the next.
template <class Body>
void parallel_ranges(std::size_t count, std::size_t grain, Body&& body)
{
    struct Call
    {
        Body& body;
        // What the race checker cannot see in the library: a part begins after the
        // loop was entered, and the loop ends after its parts.
        char entered = 0, done = 0;
    } call{body};
#ifdef CELLWARP_SANITIZED_THREAD
    __tsan_release(&call.entered);
#endif
    run_parallel(count, grain,
                 {&call, [](void* data, std::size_t begin, std::size_t end)
                  {
                      Call& own = *static_cast<Call*>(data);
#ifdef CELLWARP_SANITIZED_THREAD
                      __tsan_acquire(&own.entered);
#endif
                      own.body(begin, end);
#ifdef CELLWARP_SANITIZED_THREAD
                      __tsan_release(&own.done);
#endif
                  }});
#ifdef CELLWARP_SANITIZED_THREAD
    __tsan_acquire(&call.done);
#endif
}

/// Grain of loops whose body takes far less than a microsecond: shorter ones are not
/// worth a second thread.
inline constexpr std::size_t kSmallBodies = 256;

/// Calls body(i) for every i in [0, count).
template <class Index, class Body>
void parallel_for(Index count, std::size_t grain, Body&& body)
{
    parallel_ranges(static_cast<std::size_t>(count), grain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            body(static_cast<Index>(i));
                    });
}

template <class Index, class Body>
void parallel_for(Index count, Body&& body)
{
    parallel_for(count, 1, body);
}

/// Ascending. Equal values may end in any order, the same for every number of threads.
template <class Value>
void parallel_sort(std::vector<Value>& values)
{
    constexpr std::size_t kParts = 16, kFew = 1 << 14;
    if (values.size() < kFew)
        return std::sort(values.begin(), values.end());
    const auto begin_of = [&](std::size_t part)
    { return values.size() * std::min(part, kParts) / kParts; };
    parallel_for(kParts,
                 [&](std::size_t part) {
                     std::sort(values.data() + begin_of(part),
                               values.data() + begin_of(part + 1));
                 });
    std::vector<Value> merged(values.size());
    for (std::size_t width = 1; width < kParts; width *= 2)
    {
        parallel_for(kParts / (2 * width),
                     [&](std::size_t pair)
                     {
                         const std::size_t begin = begin_of(2 * width * pair);
                         const std::size_t middle = begin_of(2 * width * pair + width);
                         const std::size_t end = begin_of(2 * width * (pair + 1));
                         std::merge(values.data() + begin, values.data() + middle,
                                    values.data() + middle, values.data() + end,
                                    merged.data() + begin);
                     });
        values.swap(merged);
    }
}

/// Caps the threads of all loops while it lives (for good if an error ends it); 0: not.
class ThreadLimit
{
public:
    explicit ThreadLimit(int threads);
    ~ThreadLimit();
    ThreadLimit(const ThreadLimit&) = delete;
    ThreadLimit& operator=(const ThreadLimit&) = delete;

private:
    struct Control;
    std::unique_ptr<Control> control_;
};

} // namespace cellwarp::core
