// SPDX-License-Identifier: GPL-3.0-or-later
// Counts what the test program takes from the heap.
#pragma once

#include <cstddef>

namespace cellwarp::support
{

/// How often operator new was called, on all threads, since the program began. What a
/// library takes by malloc is not counted.
std::size_t num_allocations();

} // namespace cellwarp::support
