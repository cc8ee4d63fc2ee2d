// SPDX-License-Identifier: GPL-3.0-or-later
// What --json tells of an edit session, frame by frame.
#pragma once

#include <optional>
#include <string>

#include "library/session/json.h"
#include "library/session/session.h"

namespace cellwarp::core
{

Json frame_json(const FrameReport& report);

/// How the skeleton lies in the material and where its joints are; null: there is none.
Json skeleton_json(const Session& session);
/// The same for people, a line a bone; empty: there is none.
std::string skeleton_text(const Session& session);

/// How many parts a mesh has, and which of them touch; null: it is no mesh.
Json parts_json(const std::optional<Parts>& parts);
/// The same for people, in a few lines; empty: there is one.
std::string parts_text(const std::optional<Parts>& parts);

/// What the session had no need of.
Json unused_parts(const PartCounts& parts);

} // namespace cellwarp::core
