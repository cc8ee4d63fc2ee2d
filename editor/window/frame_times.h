// SPDX-License-Identifier: GPL-3.0-or-later
// How long frames took in the last moments.
#pragma once

#include <deque>
#include <utility>

namespace cellwarp
{

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

} // namespace cellwarp
