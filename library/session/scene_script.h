// SPDX-License-Identifier: GPL-3.0-or-later
// What a scene has done to its model, as the statements of one handle file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"

namespace cellwarp::core
{

/// The statements of the file \p handles (empty: none), behind the joints of the scene's
/// skeleton; its keys as frames. Nothing where the scene has neither. Throws what
/// read_handles() and skeleton_of() throw, and Fault::Malformed for keys beside frames.
std::optional<HandleFile> script_of(const SceneFile& scene, const std::string& handles,
                                    std::vector<std::string>& warnings);

} // namespace cellwarp::core
