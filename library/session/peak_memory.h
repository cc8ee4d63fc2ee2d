// SPDX-License-Identifier: GPL-3.0-or-later
// How much memory a part of the program's life takes at its peak. The one place that
// asks the system to forget an earlier peak.
#pragma once

namespace cellwarp::core
{

/// Largest resident memory of this process in its whole life [MB].
double peak_memory_mb();

/// Largest resident memory of the process since this was made.
class PeakMemory
{
public:
    /// Gives what is free back to the system, and asks it to measure anew.
    PeakMemory();

    /// [MB] Of the whole life of the process where is_since_start() is false.
    double mb() const;
    /// Whether the system lets its peak be measured anew.
    bool is_since_start() const { return is_since_start_; }

private:
    bool is_since_start_ = false;
};

} // namespace cellwarp::core
