// SPDX-License-Identifier: GPL-3.0-or-later
// The bar of progress on a terminal.
#pragma once

#include <cstddef>
#include <string>

#include "editor/cli/command.h"
#include "octree/base/clock.h"

namespace cellwarp::core
{

struct FrameProgress;

/// Draws a bar on stderr, only where that is a terminal and not quiet; at most ten times
/// a second.
class Progress
{
public:
    explicit Progress(const CommonFlags& common, std::size_t frames = 0);
    ~Progress();
    void show(const FrameProgress& now);
    /// The share that is done, in [0, 1], and what is under way.
    void show(double done, const std::string& what);
    /// Takes the bar away.
    void end();

private:
    bool is_shown_;
    std::size_t frames_;
    Clock::time_point last_ = {};
};

} // namespace cellwarp::core
