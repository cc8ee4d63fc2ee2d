// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/frame_times.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace cellwarp::core
{

namespace
{

constexpr double kSeconds = 2.0;
constexpr std::size_t kLastFrames = 5;

/// 0: none.
double median_of(std::vector<double> times)
{
    if (times.empty())
        return 0.0;
    const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
    std::nth_element(times.begin(), middle, times.end());
    return *middle;
}

} // namespace

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
    return median_of(std::move(times));
}

void LastFrames::add(double ms)
{
    frames_.push_back(ms);
    if (frames_.size() > kLastFrames)
        frames_.pop_front();
}

double LastFrames::median() const
{
    return median_of({frames_.begin(), frames_.end()});
}

double FrameTimes::worst() const
{
    double worst = 0.0;
    for (const auto& [when, ms] : frames_)
        worst = std::max(worst, ms);
    return worst;
}

} // namespace cellwarp::core
