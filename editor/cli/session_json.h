// SPDX-License-Identifier: GPL-3.0-or-later
// What --json tells of an edit session, frame by frame.
#pragma once

#include "editor/cli/command.h"
#include "editor/session/session.h"

namespace cellwarp
{

Json frame_json(const FrameReport& report);

/// What the session had no need of.
Json unused_parts(const PartCounts& parts);

} // namespace cellwarp
