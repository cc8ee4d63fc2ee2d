// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/scene_file.h"
#include "library/time/in_time.h"

namespace cellwarp::core
{

std::unique_ptr<InTime> open_in_time(const SceneFile& scene, const InTimeOptions& options)
{
    switch (scene.in_time())
    {
    case TimeScene::None:
        return nullptr;
    case TimeScene::Rods:
        return open_rods_in_time(scene, options);
    case TimeScene::Flesh:
        return open_flesh_in_time(scene, options);
    case TimeScene::FleshAndRods:
        return open_joined_in_time(scene, options);
    }
    return nullptr;
}

} // namespace cellwarp::core
