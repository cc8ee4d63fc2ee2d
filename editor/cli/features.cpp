// SPDX-License-Identifier: GPL-3.0-or-later
// The commands of the optional parts that this build has.
#include "editor/cli/command.h"
#include "editor/cli/pictures.h"

#ifdef CELLWARP_WITH_PICTURE
#include "editor/cli/render.h"
#endif
#ifdef CELLWARP_WITH_SKELETON
#include "editor/cli/skeleton.h"
#endif

namespace cellwarp::core
{

void add_features([[maybe_unused]] CLI::App& app, [[maybe_unused]] CommonFlags& common,
                  [[maybe_unused]] int& exit_code)
{
#ifdef CELLWARP_WITH_PICTURE
    add_render(app, common, exit_code);
#endif
#if defined(CELLWARP_WITH_RODS) || defined(CELLWARP_WITH_SKELETON)
    add_simulate(app, common, exit_code);
#endif
#ifdef CELLWARP_WITH_SKELETON
    add_skeleton(app, common, exit_code);
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

} // namespace cellwarp::core
