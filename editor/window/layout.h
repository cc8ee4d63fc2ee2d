// SPDX-License-Identifier: GPL-3.0-or-later
// Places of the window's parts: the menu bar on top, below it a column of tools, the view
// with a bar of options above it and, on the right, the panel; the status bar at the
// bottom.
#pragma once

#include "editor/window/canvas.h"

namespace cellwarp::core
{

/// The panel as the user wants it.
struct PanelWish
{
    bool is_shown = true;
    double width = 0.0; ///< [letters]; 0: as wide as is usual
};

/// Parts of the window [pixel of the screen].
struct Layout
{
    ViewRect tools;    ///< the column
    ViewRect options;  ///< the bar above the view
    ViewRect view;     ///< the shape
    ViewRect splitter; ///< between the view and the panel
    ViewRect panel;    ///< width 0: hidden
    ViewRect status;
    int num_columns = 1;      ///< of tools side by side
    bool shows_names = false; ///< of tools, below their pictures
};

/// Sizes that the layout follows [pixel of the screen].
struct LayoutSizes
{
    int width = 0, height = 0; ///< of the window
    float letter = 1.0f;       ///< width of a letter of the font
    float menu = 0.0f;         ///< height of the menu bar
    int num_tools = 0;         ///< 0: no document, the view has all the room
};

Layout lay_out(const LayoutSizes& sizes, const PanelWish& wish);

/// Side of a tool's button, and its height with a name below [letters].
constexpr float kToolSide = 3.8f, kToolHeight = 5.1f;
/// Space around and between the buttons of tools [letters].
constexpr float kToolGap = 0.4f;

/// The width that a drag of the splitter to \p x asks for; not shown where that is too
/// narrow to be read. \p x: of the pointer [pixel of the screen].
PanelWish wish_at(double x, const LayoutSizes& sizes);

} // namespace cellwarp::core
