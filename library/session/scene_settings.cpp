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
    const SceneSettings stated = with_usual_values(scene.settings);
    const bool is_paper = stated.energy == "botsch07";
    SessionSettings settings;
    CellSettings& cells = settings.cells;
    cells.fill = stated.cells.fill == "shell" ? Fill::Shell : Fill::Solid;
    cells.has_lids = stated.cells.fill == "closed";
    cells.across = static_cast<int>(stated.cells.across.value_or(cells.across));
    cells.max_depth = static_cast<int>(*stated.cells.max_depth);
    cells.threshold = *stated.cells.threshold;
    cells.gap = *stated.cells.gap;
    cells.thickness = *stated.cells.thickness;
    cells.is_flat = stated.cells.flat;
    cells.loose_follow = stated.cells.loose == "follow";
    cells.joins_parts = *stated.cells.join;
    cells.has_contact = *stated.cells.contact;
    cells.max_cells = *stated.cells.max_cells;
    cells.frame = scene.frame;
    cells.frame_file = scene.path;
    if (is_paper) // defaults of the paper's method
    {
        cells.threshold = scene.settings.cells.threshold.value_or(kUsualGap);
        cells.loose_follow = scene.settings.cells.loose == "follow";
        cells.is_flat = cells.is_flat.value_or(false); // it keeps no plane
    }
    if (cells.threshold == 0.0)
        cells.min_depth = cells.max_depth;
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
