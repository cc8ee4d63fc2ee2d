// SPDX-License-Identifier: GPL-3.0-or-later
// How panels look: colours for dark and light, spacing, the font.
#pragma once

#include <imgui.h>

namespace cellwarp::core
{

/// Colours that panels use beside ImGui's own.
struct Palette
{
    ImVec4 accent, faint, error, warning, good, bar, view_ink, pill;
};

const Palette& palette();

/// \p scale: pixels of the screen for one of ours.
void apply_style(bool is_dark, float scale);

/// Loads a font of the system into ImGui, or its own where there is none.
void load_fonts(float scale);
ImFont* heading_font();
ImFont* small_font();

} // namespace cellwarp::core
