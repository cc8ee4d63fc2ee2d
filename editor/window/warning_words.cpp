// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/warning_words.h"

#include <array>
#include <cctype>
#include <string_view>

#include "editor/document/document.h"

namespace cellwarp::core
{

namespace
{

struct Words
{
    const char* said;   ///< on the command line
    const char* window; ///< here
};

/// Flags by the names of what sets the same here, longer ones first.
constexpr std::array<Words, 13> kWords = {
    {{"'about border' turns it there", "Shift+V turns it there"},
     {" (a thicker shell folds less: --thickness)", " (a thicker shell folds less)"},
     {"--fill closed", "Fill: Solid, openings closed (under Cells)"},
     {"--fill solid", "Fill: Solid (under Cells)"},
     {"--fill shell", "Fill: Shell (under Cells)"},
     {"--loose stay", "Loose parts: Stay (under Cells)"},
     {"--max-depth", "Depth (under Cells)"},
     {"--max-cells", "'max_cells' of the scene"},
     {"--no-flat", "'A flat model bends: In space' (under Cells)"},
     {"--across", "Across (under Cells)"},
     {"--gap", "Gap (under Cells)"},
     {"--join", "'Join parts that touch' (under Cells)"},
     {"--thickness", "'thickness' of the scene's cells"}}};
/// The advice to turn contact on, after a warning that parts pass through each other.
constexpr std::string_view kPassing = "parts pass through each other";
constexpr std::string_view kContact = " (Contact, under Cells, keeps them apart)";

/// Takes "FILE:12: " or "FILE: " from the beginning.
void drop_file(std::string& text, const std::string& file)
{
    if (file.empty() || !text.starts_with(file + ":"))
        return;
    std::size_t end = file.size() + 1;
    while (end < text.size() && std::isdigit(static_cast<unsigned char>(text[end])) != 0)
        ++end;
    if (end < text.size() && text[end] == ':')
        ++end;
    while (end < text.size() && text[end] == ' ')
        ++end;
    text.erase(0, end);
}

} // namespace

std::string in_window_words(const std::string& warning, const Document& document)
{
    std::string text = warning;
    for (const std::string& file :
         {document.handles().path, document.scene_path(), document.path()})
        drop_file(text, file);
    for (const Words& words : kWords)
    {
        const std::string_view said = words.said, window = words.window;
        for (std::size_t at = text.find(said); at != std::string::npos;
             at = text.find(said, at + window.size()))
            text.replace(at, said.size(), window);
    }
    if (text.ends_with(kPassing) && !document.settings().cells.contact.value_or(false))
        text += kContact;
    return text;
}

} // namespace cellwarp::core
