// SPDX-License-Identifier: GPL-3.0-or-later
// Counts what the test program takes from the heap.
#pragma once

#include <cstddef>

namespace cellwarp::core::support
{

/// How often the program's own code took memory, by operator new or as Eigen's vectors
/// do, on all threads, since it began. What shared libraries take is not counted.
std::size_t num_allocations();

/// The most that operator new had given and not got back at any time since this was
/// made, beyond what it had then [byte]; on all threads. One at a time.
class MostMemory
{
public:
    MostMemory();
    std::size_t bytes() const;

private:
    std::size_t before_;
};

/// Lets one of those that num_allocations() counts fail, as where there is no memory: the
/// \p which th from now on, on whatever thread; none after this is gone. One at a time.
class FailingAllocation
{
public:
    explicit FailingAllocation(std::size_t which);
    ~FailingAllocation();
    FailingAllocation(const FailingAllocation&) = delete;
    FailingAllocation& operator=(const FailingAllocation&) = delete;
    bool has_failed() const;
};

} // namespace cellwarp::core::support
