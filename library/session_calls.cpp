// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session_calls.h"

#include <algorithm>

namespace cellwarp
{

namespace
{

/// The first cells count as a part of the call; the rest is the frames'.
constexpr double kShareOfCells = 0.2;

} // namespace

FrameWatch::FrameWatch(Watcher& watcher, std::size_t num_frames) : watcher_(watcher)
{
    watcher_.progress().all = num_frames;
    watcher_.begin("cells", 0.0);
}

double FrameWatch::share_of(double frames) const
{
    const double all = static_cast<double>(watcher_.progress().all);
    return kShareOfCells + (1.0 - kShareOfCells) * (all > 0.0 ? frames / all : 1.0);
}

void FrameWatch::attach(core::SessionSettings& settings)
{
    settings.watch = [this](const core::FrameProgress& now) { see(now); };
}

void FrameWatch::see(const core::FrameProgress& now)
{
    Progress& progress = watcher_.progress();
    progress.phase = "solve";
    progress.iteration = now.iteration;
    progress.gradient = now.gradient;
    progress.energy = now.energy;
    const double part =
        std::clamp(static_cast<double>(now.step) / std::max(now.steps, 1), 0.0, 1.0);
    watcher_.set_share(share_of(static_cast<double>(progress.done) + part));
    watcher_.show();
}

bool FrameWatch::next_frame(core::Session& session, bool wants_samples)
{
    Progress& progress = watcher_.progress();
    watcher_.begin("solve", share_of(static_cast<double>(progress.done)));
    if (!session.next_frame(wants_samples))
        return false;
    ++progress.done;
    watcher_.set_share(share_of(static_cast<double>(progress.done)));
    return true;
}

} // namespace cellwarp
