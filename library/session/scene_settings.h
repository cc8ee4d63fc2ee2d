// SPDX-License-Identifier: GPL-3.0-or-later
// What a scene file says, as settings of a session.
#pragma once

#include "io/scene/scene_file.h"
#include "library/session/session.h"

namespace cellwarp::core
{

/// What the scene leaves out has its default. \p is_preview: with the field of drags.
SessionSettings settings_of(const SceneFile& scene, bool is_preview = false);

/// Takes these departures, the fields that belong to them, and with none of them the
/// paper's solver.
void use(const Departures& departures, SessionSettings& settings);

} // namespace cellwarp::core
