// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/progress.h"

#include <algorithm>

#include <unistd.h>

#include <fmt/format.h>

#include "library/session/session_settings.h"

namespace cellwarp::core
{

Progress::Progress(const CommonFlags& common, std::size_t frames)
    : is_shown_(!common.is_quiet && ::isatty(2)), frames_(frames)
{
}

Progress::~Progress()
{
    end();
}

void Progress::end()
{
    if (is_shown_)
        say("\r\x1b[K");
}

void Progress::show(const FrameProgress& now)
{
    if (!is_shown_ || frames_ == 0)
        return;
    const double done =
        (static_cast<double>(now.frames_done) +
         static_cast<double>(now.step - 1) / static_cast<double>(now.steps)) /
        static_cast<double>(frames_);
    show(done,
         fmt::format("frame {} ({}/{}), step {}/{}, gradient {:.1e}", now.frame,
                     now.frames_done + 1, frames_, now.step, now.steps, now.gradient));
}

void Progress::show(double done, const std::string& what)
{
    constexpr std::size_t kWidth = 30;
    constexpr auto kPause = std::chrono::milliseconds(100);
    const auto time = Clock::now();
    if (!is_shown_ || time - last_ < kPause)
        return;
    last_ = time;
    const std::size_t full = static_cast<std::size_t>(kWidth * std::min(1.0, done));
    say(fmt::format("\r[{}{}] {}\x1b[K", std::string(full, '#'),
                    std::string(kWidth - full, ' '), what));
    std::fflush(stderr);
}

} // namespace cellwarp::core
