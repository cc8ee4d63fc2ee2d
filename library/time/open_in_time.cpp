// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/time_settings.h"
#include "library/time/in_time.h"

namespace cellwarp::core
{

std::unique_ptr<InTime> open_in_time(const std::string& input,
                                     const InTimeOptions& options)
{
    switch (time_scene_of(input))
    {
    case TimeScene::None:
        break;
    case TimeScene::Rods:
        return open_rods_in_time(input, options);
    case TimeScene::Flesh:
        return open_flesh_in_time(input, options);
    case TimeScene::FleshAndRods:
        return open_joined_in_time(input, options);
    }
    return nullptr;
}

} // namespace cellwarp::core
