// SPDX-License-Identifier: GPL-3.0-or-later
// A part of the threads for one piece of work, without a change for the rest of the
// process.
#pragma once

#include <type_traits>

namespace cellwarp::core
{

/// Calls \p call(body), whose loops (parallel.h) have at most so many threads; 0: all.
/// Throws what it throws.
void run_with_threads(int threads, void* body, void (*call)(void*));

template <class Body>
void with_threads(int threads, Body&& body)
{
    using Own = std::remove_reference_t<Body>;
    run_with_threads(threads, &body, [](void* own) { (*static_cast<Own*>(own))(); });
}

} // namespace cellwarp::core
