// SPDX-License-Identifier: GPL-3.0-or-later
// Small things that several panels are made of.
#pragma once

#include <cstdint>
#include <string>

#include <imgui.h>

#include "editor/window/colours.h"

namespace cellwarp::core
{

/// The width of \p count letters: panels measure in it, so they follow the font.
float letters(float count);

ImU32 packed(const ImVec4& colour);
ImVec4 shown(const Colour& colour);

/// "1,234,567"
std::string counted(std::int64_t count);
/// "1 cell", "1,234 cells"
std::string counted(std::int64_t count, const char* one, const char* many);
/// Three significant digits, no exponent where that is readable.
std::string rounded(double value);

/// A heading that opens and closes what follows; \p summary stands on its right.
bool section(const char* name, bool is_open_at_first, const std::string& summary = "");
/// Two short values in one row.
void value_pair(const char* left, const std::string& left_value, const char* right,
                const std::string& right_value);
/// Where the right one of two values in a row begins.
float second_column();
/// A word on the left, and the cursor where its value begins.
void label(const char* text);
void faint_text(const std::string& text);
/// Wrapped, in a colour of the palette, with a mark before it.
void error_text(const std::string& text);
void warning_text(const std::string& text);
void tip(const char* text); ///< of the last item, where the pointer rests on it

/// Whether keys act on the last item, which is then to be marked.
bool has_keyboard();

/// A button that stays down; true if it was pressed.
bool toggle(const char* name, bool is_on);

} // namespace cellwarp::core
