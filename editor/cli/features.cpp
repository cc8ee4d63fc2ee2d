// SPDX-License-Identifier: GPL-3.0-or-later
// The one file that knows which optional parts this build has.
#include "editor/cli/command.h"

#ifdef CELLWARP_WITH_PICTURE
#include "editor/cli/render.h"
#endif
#ifdef CELLWARP_WITH_RODS
#include "editor/cli/simulate.h"
#endif
#ifdef CELLWARP_WITH_SKELETON
#include "editor/cli/skeleton.h"
#endif

namespace cellwarp
{

void add_features([[maybe_unused]] CLI::App& app, [[maybe_unused]] CommonFlags& common,
                  [[maybe_unused]] int& exit_code)
{
#ifdef CELLWARP_WITH_PICTURE
    add_render(app, common, exit_code);
#endif
#ifdef CELLWARP_WITH_RODS
    add_simulate(app, common, exit_code);
#endif
#ifdef CELLWARP_WITH_SKELETON
    add_skeleton(app, common, exit_code);
#endif
}

std::optional<Film> film_of([[maybe_unused]] const std::string& input)
{
#ifdef CELLWARP_WITH_RODS
    return film_of_rods(input);
#else
    return std::nullopt;
#endif
}

Json rods_in_time([[maybe_unused]] const std::string& scene)
{
#ifdef CELLWARP_WITH_RODS
    return rods_of_scene(scene);
#else
    return Json::array();
#endif
}

std::optional<Pictures> make_pictures()
{
#ifdef CELLWARP_WITH_PICTURE
    return rendered_pictures();
#else
    return std::nullopt;
#endif
}

} // namespace cellwarp
