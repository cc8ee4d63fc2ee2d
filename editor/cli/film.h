// SPDX-License-Identifier: GPL-3.0-or-later
// Frames of a scene in time, as pictures need them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "library/time/in_time.h"

namespace cellwarp::core
{

/// A scene in time.
struct Film
{
    std::int64_t last = 0; ///< number of its last frame; the first is 0
    /// The shapes of a frame; frames are asked for in ascending order.
    std::function<FilmFrame(std::int64_t frame)> frame;
    /// Whether all that was asked for so far converged.
    std::function<bool()> is_converged;
    std::function<std::vector<std::string>()> warnings; ///< so far
};
/// Nothing for models and for scenes of edits.
std::optional<Film> film_of(const SceneFile& scene);

} // namespace cellwarp::core
