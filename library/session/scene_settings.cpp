// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/scene_settings.h"

namespace cellwarp::core
{

void use(const Departures& departures, SessionSettings& settings)
{
    settings.departures = departures;
    if (departures == kBotsch07)
        settings.method = Method::GaussNewton;
    FieldKind& field = settings.field.kind;
    if (field == FieldKind::Rbf && !departures.local_rbf)
        field = FieldKind::RbfCentres;
    if (field == FieldKind::Blend && !departures.blend)
        field = FieldKind::Closest4;
}

SessionSettings settings_of(const SceneFile& scene, bool is_preview)
{
    SessionSettings settings;
    CellSettings& cells = settings.cells;
    cells.fill = scene.settings.cells.fill == "shell" ? Fill::Shell : Fill::Solid;
    cells.has_lids = scene.settings.cells.fill == "closed";
    cells.across = static_cast<int>(scene.settings.cells.across.value_or(cells.across));
    cells.max_depth =
        static_cast<int>(scene.settings.cells.max_depth.value_or(kUsualDepth));
    const bool is_paper = scene.settings.energy == "botsch07";
    cells.threshold =
        scene.settings.cells.threshold.value_or(is_paper ? kUsualGap : kUsualThreshold);
    if (cells.threshold == 0.0)
        cells.min_depth = cells.max_depth;
    cells.gap = scene.settings.cells.gap.value_or(cells.gap);
    cells.thickness = scene.settings.cells.thickness.value_or(cells.thickness);
    cells.is_flat = scene.settings.cells.flat;
    if (is_paper && !cells.is_flat)
        cells.is_flat = false; // a plane that is kept is none of its method
    cells.loose_follow =
        scene.settings.cells.loose.value_or(is_paper ? "stay" : "follow") == "follow";
    cells.joins_parts = scene.settings.cells.join.value_or(cells.joins_parts);
    cells.has_contact = scene.settings.cells.contact.value_or(cells.has_contact);
    cells.max_cells = scene.settings.cells.max_cells.value_or(cells.max_cells);
    cells.frame = scene.frame;
    cells.frame_file = scene.path;
    if (is_paper)
        use(kBotsch07, settings);
    const Departures& departures = settings.departures;
    if (is_preview || scene.settings.field.release == "blend")
        settings.field = scene.settings.field.drag.value_or(
                             departures.blend ? "blend" : "closest4") == "closest4"
                             ? FieldKind::Closest4
                             : FieldKind::Blend;
    else if (scene.settings.field.release == "rbf-global")
        settings.field = FieldKind::RbfGlobal;
    else
        settings.field = scene.settings.field.release || departures.local_rbf
                             ? FieldKind::Rbf
                             : FieldKind::RbfCentres;
    return settings;
}

} // namespace cellwarp::core
