// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/hints.h"

#include <algorithm>

namespace cellwarp::core
{

std::string next_step(const Document& document, const Progress& progress)
{
    const bool is_bent =
        std::any_of(document.handles().stages.begin(), document.handles().stages.end(),
                    [](const Stage& stage) { return !stage.frames.empty(); });
    const auto has = [&](auto&& is)
    { return std::any_of(document.regions().begin(), document.regions().end(), is); };
    if (progress.is_dragging && progress.num_drags == 0 && !is_bent)
        return "Let go where it should be; Ctrl+Z undoes";
    const bool has_shifted = has(
        [](const EditedRegion& region) {
            return region.role == Role::Handle && !region.placement.translation.isZero(0);
        });
    const bool has_turned =
        has([](const EditedRegion& region) { return region.placement.degrees != 0.0; });
    if (progress.num_drags == 1 && !progress.is_dragging && has_shifted && !has_turned)
        return "R turns the handle, too: a hand that only moves kinks its wrist";
    if (progress.num_drags > 0 || is_bent)
        return "";
    if (!has([](const EditedRegion& region) { return region.role == Role::Fixed; }))
        return document.selection().empty()
                   ? "Paint or box-select the part that stays; press J to fix it"
                   : "Press J to fix what is selected";
    if (!has([](const EditedRegion& region) { return region.moves(); }))
        return "Select the part to grab; press H";
    return progress.tool == Tool::Move
               ? "Drag the arrows, or press G to move it and R to turn it"
               : "Press G to move it and R to turn it, or 5 for its arrows";
}

} // namespace cellwarp::core
