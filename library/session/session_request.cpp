// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/session_request.h"

#include <utility>

#include "io/base/error.h"
#include "io/scene/saved_pair.h"
#include "library/session/memory_limit.h"
#include "library/session/scene_script.h"
#include "library/session/scene_settings.h"

namespace cellwarp::core
{

SessionRequest request_of(SceneFile of, ForTime for_time, const SceneChanges& changes)
{
    SessionRequest request;
    SceneFile& scene = request.scene = std::move(of);
    need_model(scene);
    request.warnings = scene.warnings;
    if (for_time == ForTime::No && scene.time.carries())
        throw malformed({scene.path, 0, "rods"},
                        "carry the model in time: this is for cellwarp simulate");
    if (for_time == ForTime::No)
        request.warnings.insert(request.warnings.end(), scene.left_out.begin(),
                                scene.left_out.end());
    request.read.columns = changes.columns;
    const std::string file =
        changes.handle_file.empty() ? scene.handles : changes.handle_file;
    request.handles =
        changes.script ? changes.script : script_of(scene, file, request.warnings);
    if (request.handles && !changes.script && !file.empty() && file == scene.handles)
        if (const auto parted = parted_save(scene, *request.handles))
            request.warnings.push_back(*parted);

    visit_settings(
        [](const SettingText&, const auto&, const auto&, const auto& given,
           auto& in_scene)
        {
            if (given)
                in_scene = given;
        },
        changes.settings, scene.settings);
    request.settings = settings_of(scene, changes.is_preview);
    request.settings.cells.max_memory =
        changes.max_memory ? *changes.max_memory : default_memory_limit();
    check_memory_of_file(scene.model, request.settings.cells.max_memory);
    return request;
}

} // namespace cellwarp::core
