// SPDX-License-Identifier: GPL-3.0-or-later
// The panels: each shows a part of the app and calls its commands. They decide nothing
// and keep nothing but what is being typed.
#pragma once

#include <optional>
#include <string>

#include "editor/window/editor_app.h"
#include "editor/window/panel_focus.h"

namespace cellwarp::core
{

/// A place that is being dragged in a number field: shown at once, one edit at the end.
struct PlacementEntry
{
    bool is_held = false; ///< the document's drag is ours
    /// The drag has ended, by Escape for instance, but the button is still down.
    bool is_over = false;
    std::string region; ///< that is held
    RigidMove value;
};

/// What is being typed, and belongs to no document yet.
struct PanelState
{
    PlacementEntry placement;
    std::string renamed; ///< the region whose name is being typed
    std::string name;    ///< as typed so far
    /// Being typed: of a stiff region, of a rod, of a pin on a curve.
    std::optional<double> factor, radius, stiffness, share;
    SceneSettings settings; ///< while a number of it is typed
    bool types_settings = false;
    std::size_t history_position = 0; ///< that the list was scrolled to
};

void show_document_panel(EditorApp& app);
void show_regions_panel(EditorApp& app, PanelState& state);
void show_cells_panel(EditorApp& app, PanelState& state);
void show_field_panel(EditorApp& app);
void show_solver_panel(EditorApp& app);
void show_history_panel(EditorApp& app, PanelState& state);
void show_view_panel(EditorApp& app);

constexpr int kNumTools = 7;

/// The bars around the view. The menu bar also gives its height [pixel].
float show_menu_bar(EditorApp& app, PanelFocus& focus);
void show_tool_column(EditorApp& app, const Layout& layout);
/// Shows the settings of the active tool and of the view, and what is played.
void show_tool_options(EditorApp& app);
void show_status_bar(EditorApp& app);
/// Over the view's lower edge while a film is played: its frames.
void show_film_bar(EditorApp& app, const ViewRect& view);

/// Over the view, where nothing is open.
void show_welcome_page(EditorApp& app, const ViewRect& view);
void show_keys_page(EditorApp& app);

} // namespace cellwarp::core
