// SPDX-License-Identifier: GPL-3.0-or-later
// The one file of this room that depends on which parts this build has.
#include "io/base/error.h"
#include "io/scene/time_settings.h"
#include "library/time/in_time.h"

namespace cellwarp::core
{

std::unique_ptr<InTime> open_in_time(const std::string& input,
                                     [[maybe_unused]] const InTimeOptions& options)
{
    switch (time_scene_of(input))
    {
    case TimeScene::None:
        return nullptr;
    case TimeScene::Rods:
#ifdef CELLWARP_WITH_RODS
        return open_rods_in_time(input, options);
#else
        break;
#endif
    case TimeScene::Flesh:
#ifdef CELLWARP_WITH_SKELETON
        return open_flesh_in_time(input, options);
#else
        break;
#endif
    case TimeScene::FleshAndRods:
#if defined(CELLWARP_WITH_RODS) && defined(CELLWARP_WITH_SKELETON)
        return open_joined_in_time(input, options);
#else
        break;
#endif
    }
#if defined(CELLWARP_WITH_RODS) || defined(CELLWARP_WITH_SKELETON)
    throw Error(Fault::Usage,
                at({input, 0, ""}, "this build has no part that moves it in time "
                                   "(CELLWARP_RODS, CELLWARP_SKELETON)"));
#else
    return nullptr; // scenes are for edits alone
#endif
}

Json scene_in_time([[maybe_unused]] const std::string& scene)
{
#ifdef CELLWARP_WITH_RODS
    return time_of_scene(scene);
#else
    return nullptr;
#endif
}

std::optional<RodFacts> facts_of_rods([[maybe_unused]] const std::string& input)
{
#ifdef CELLWARP_WITH_RODS
    if (has_rods(time_scene_of(input)))
        return facts_of_rod_scene(input);
#endif
    return std::nullopt;
}

std::optional<FleshFacts> flesh_in_time([[maybe_unused]] const std::string& input,
                                        [[maybe_unused]] const HandleFile& handles,
                                        [[maybe_unused]] const Geometry& geometry,
                                        [[maybe_unused]] const CellSettings& cells)
{
#ifdef CELLWARP_WITH_SKELETON
    if (has_flesh(time_scene_of(input)))
        return flesh_of_scene(input, handles, geometry, cells);
#endif
    return std::nullopt;
}

} // namespace cellwarp::core
