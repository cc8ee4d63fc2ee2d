// SPDX-License-Identifier: GPL-3.0-or-later
// A save writes a scene and its handle file one after the other. Each says which save it
// is of, so that what ended in between is noticed.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"

namespace cellwarp::core
{

/// The fingerprint of a save, from the texts of both files.
std::string save_fingerprint(std::string_view scene_text, std::string_view handle_text);

/// What is to be said where a scene and the handle file that it names are of two saves:
/// "SCENE: ...". What people have written themselves is of none.
std::optional<std::string> parted_save(const SceneFile& scene, const HandleFile& handles);

} // namespace cellwarp::core
