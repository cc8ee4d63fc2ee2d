// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/frame_times.h"

#include <algorithm>
#include <vector>

namespace cellwarp
{

namespace
{

constexpr double kSeconds = 2.0;

}

void FrameTimes::add(double now, double ms)
{
    frames_.emplace_back(now, ms);
    while (frames_.front().first < now - kSeconds)
        frames_.pop_front();
}

double FrameTimes::median() const
{
    std::vector<double> times;
    for (const auto& [when, ms] : frames_)
        times.push_back(ms);
    if (times.empty())
        return 0.0;
    const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
    std::nth_element(times.begin(), middle, times.end());
    return *middle;
}

double FrameTimes::worst() const
{
    double worst = 0.0;
    for (const auto& [when, ms] : frames_)
        worst = std::max(worst, ms);
    return worst;
}

} // namespace cellwarp
