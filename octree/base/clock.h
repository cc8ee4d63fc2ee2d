// SPDX-License-Identifier: GPL-3.0-or-later
// How long something took.
#pragma once

#include <chrono>

namespace cellwarp
{

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

inline double ms_since(Clock::time_point start)
{
    return 1e3 * seconds_since(start);
}

} // namespace cellwarp
