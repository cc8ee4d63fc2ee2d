// SPDX-License-Identifier: GPL-3.0-or-later
// Counts what the test program takes from the heap.
#pragma once

#include <cstddef>

namespace cellwarp::support
{

/// How often operator new was called, on all threads, since the program began. What a
/// library takes by malloc is not counted.
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

} // namespace cellwarp::support
