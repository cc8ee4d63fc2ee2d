// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/saved_pair.h"

#include <filesystem>

#include "io/base/checksum.h"
#include "io/base/error.h"
#include "io/base/number.h"

namespace cellwarp::core
{

std::string save_fingerprint(std::string_view scene_text, std::string_view handle_text)
{
    return std::to_string(checksum_of(handle_text, checksum_of(scene_text)));
}

std::optional<std::string> parted_save(const SceneFile& scene, const HandleFile& handles)
{
    const std::string name = std::filesystem::path(scene.path).filename().string();
    if (!handles.save || handles.save->scene != name || scene.save == handles.save->print)
        return std::nullopt;
    return at({scene.path, 0, "handles"},
              in_quotes(handles.path) + " is from another save than this scene: a save "
                                        "ended between the two, or one was replaced");
}

} // namespace cellwarp::core
