// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/scene_script.h"

#include <algorithm>

#include "io/base/error.h"
#include "library/session/retargeted_motion.h"
#include "library/session/skeleton_handle.h"

namespace cellwarp::core
{

std::optional<HandleFile> script_of(const SceneFile& scene, const std::string& handles,
                                    std::vector<std::string>& warnings)
{
    if (!scene.skeleton)
        return handles.empty() ? std::nullopt : std::optional(read_handles(handles));
    const SkeletonValues skeleton = moving_skeleton(*scene.skeleton, scene.path);
    warnings.insert(warnings.end(), skeleton.warnings.begin(), skeleton.warnings.end());
    HandleFile file;
    if (handles.empty())
    {
        file.path = scene.path;
        file.stages.emplace_back().joints = skeleton.joints;
    }
    else
        file = read_handles(handles, skeleton.joints);
    const bool has_keys = !key_times(skeleton).empty();
    const bool has_frames =
        std::any_of(file.stages.begin(), file.stages.end(),
                    [](const Stage& stage) { return !stage.frames.empty(); });
    // Keys of the scene are meant; those that only came with a file give way.
    if (has_frames && !scene.skeleton->motion.file.empty())
        throw malformed({scene.path, 0, "skeleton.motion"},
                        "stands beside the frames of " + handles +
                            ": one of them moves the skeleton");
    if (has_frames && !scene.skeleton->keys.empty())
        throw malformed({scene.path, 0, "skeleton.keys"},
                        "stand beside the frames of " + handles +
                            ": one of them moves the skeleton");
    if (has_frames && has_keys)
        warnings.push_back(at({scene.path, 0, "skeleton.file"},
                              "its keys are not used: the handle file has frames"));
    if (!has_frames && has_keys)
        file.stages.front().frames =
            posed_frames(skeleton, scene.skeleton->every, scene.path, warnings);
    return file;
}

} // namespace cellwarp::core
