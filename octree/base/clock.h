// SPDX-License-Identifier: GPL-3.0-or-later
// How long something took.
#pragma once

#include <chrono>

namespace cellwarp::core
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

/// The point in time \p seconds after \p start; more than three years are for ever.
inline Clock::time_point time_after(Clock::time_point start, double seconds)
{
    constexpr double kForEver = 1e8;
    return seconds < kForEver ? start + std::chrono::duration_cast<Clock::duration>(
                                            std::chrono::duration<double>(seconds))
                              : Clock::time_point::max();
}

} // namespace cellwarp::core
