// SPDX-License-Identifier: GPL-3.0-or-later
// How long frames took.
#pragma once

#include <deque>
#include <utility>

namespace cellwarp::core
{

/// In the last moments.
class FrameTimes
{
public:
    /// A frame that ended at \p now [s] and took \p ms.
    void add(double now, double ms);
    double median() const; ///< [ms] of the last two seconds; 0: none
    double worst() const;

private:
    std::deque<std::pair<double, double>> frames_;
};

/// How long the last few frames took that showed all there is, however long ago that was:
/// what the next one of that kind will take.
class LastFrames
{
public:
    void add(double ms);
    void clear() { frames_.clear(); }
    double median() const; ///< [ms]; 0: none

private:
    std::deque<double> frames_;
};

} // namespace cellwarp::core
