// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/scene_settings.h"

namespace cellwarp
{

SessionSettings settings_of(const SceneFile& scene, bool is_preview)
{
    SessionSettings settings;
    CellSettings& cells = settings.cells;
    cells.fill = scene.fill == "shell" ? Fill::Shell : Fill::Solid;
    cells.across = static_cast<int>(scene.across.value_or(cells.across));
    cells.max_depth = static_cast<int>(scene.max_depth.value_or(kUsualDepth));
    cells.threshold = scene.threshold.value_or(kUsualThreshold);
    if (cells.threshold == 0.0)
        cells.min_depth = cells.max_depth;
    cells.gap = scene.gap.value_or(cells.gap);
    cells.thickness = scene.thickness.value_or(cells.thickness);
    cells.max_cells = scene.max_cells.value_or(cells.max_cells);
    cells.frame = scene.frame;
    cells.frame_file = scene.path;
    if (is_preview || scene.release == "blend")
        settings.field =
            scene.drag == "closest4" ? FieldKind::Closest4 : FieldKind::Blend;
    else
        settings.field =
            scene.release == "rbf-global" ? FieldKind::RbfGlobal : FieldKind::Rbf;
    return settings;
}

} // namespace cellwarp
