// SPDX-License-Identifier: GPL-3.0-or-later
// The panels: each shows a part of the desk and calls its commands. They decide nothing
// and keep nothing but what is being typed.
#pragma once

#include <optional>
#include <string>

#include "editor/window/desk.h"

namespace cellwarp
{

/// A place that is being dragged in a number field: shown at once, one edit at the end.
struct PlacementEntry
{
    bool is_held = false; ///< the document's drag is ours
    /// The drag has ended, by Escape for instance, but the button is still down.
    bool is_over = false;
    std::string region; ///< that is held
    Placement value;
};

/// What is being typed, and belongs to no document yet.
struct PanelState
{
    PlacementEntry placement;
    std::string renamed; ///< the region whose name is being typed
    std::string name;    ///< as typed so far
    std::optional<double> factor;
    EditSettings settings; ///< while a number of it is typed
    bool types_settings = false;
    std::size_t history_position = 0; ///< that the list was scrolled to
};

void show_document_panel(Desk& desk);
void show_regions_panel(Desk& desk, PanelState& state);
void show_cells_panel(Desk& desk, PanelState& state);
void show_field_panel(Desk& desk);
void show_solver_panel(Desk& desk);
void show_history_panel(Desk& desk, PanelState& state);
void show_view_panel(Desk& desk);

/// The bars around the view. The menu bar also gives its height [pixel].
float show_menu_bar(Desk& desk);
void show_tool_bar(Desk& desk);
void show_status_bar(Desk& desk);

/// Over the view, where nothing is open.
void show_welcome_page(Desk& desk, const ViewRect& view);
void show_keys_page(Desk& desk);

} // namespace cellwarp
