// SPDX-License-Identifier: GPL-3.0-or-later
// Progress of a session's frames.
#pragma once

#include <cstddef>

#include "library/calls.h"
#include "library/session/session.h"

namespace cellwarp
{

/// Shows the frames of one call. It must outlive the work of the session that it is
/// attached to.
class FrameWatch
{
public:
    FrameWatch(Watcher& watcher, std::size_t num_frames);

    void attach(core::SessionSettings& settings);
    /// Sees an iteration of the solve.
    void see(const core::FrameProgress& now);
    /// core::Session::next_frame(), with its progress.
    bool next_frame(core::Session& session, bool wants_samples);

private:
    /// Of the whole call, when so many frames are done.
    double share_of(double frames) const;

    Watcher& watcher_;
};

} // namespace cellwarp
