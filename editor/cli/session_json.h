// SPDX-License-Identifier: GPL-3.0-or-later
// What --json tells of an edit session, frame by frame.
#pragma once

#include "editor/cli/command.h"
#include "editor/session/session.h"

namespace cellwarp
{

Json frame_json(const FrameReport& report);

/// How the skeleton lies in the material and where its joints are; null: there is none.
Json skeleton_json(const Session& session);
/// The same for people, a line a bone; empty: there is none.
std::string skeleton_text(const Session& session);

/// What the session had no need of.
Json unused_parts(const PartCounts& parts);

} // namespace cellwarp
