// SPDX-License-Identifier: GPL-3.0-or-later
// What is drawn over the view: the gizmo, outlines of gestures, what would be picked, the
// scale of the cells' colours, and what the user may do next.
#pragma once

#include "editor/window/editor_app.h"

namespace cellwarp::core
{

/// \p scale: pixels of the screen for one of the hand's. \p cells: what their colours
/// mean.
void draw_overlay(EditorApp& app, const ViewRect& view, double scale,
                  const CellScale& cells);

} // namespace cellwarp::core
