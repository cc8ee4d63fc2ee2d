// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/warning_words.h"

#include <array>
#include <cctype>

#include "editor/document/document.h"

namespace cellwarp
{

namespace
{

struct Words
{
    const char* said;   ///< on the command line
    const char* window; ///< here
};

constexpr std::array<Words, 3> kWords = {
    {{"'about border' turns it there", "Shift+V turns it there"},
     {" (a thicker shell folds less: --thickness)", " (a thicker shell folds less)"},
     {": parts pass through each other",
      ": parts pass through each other (Contact, under Cells, keeps them apart)"}}};

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
    const bool has_contact = document.settings().cells.contact.value_or(false);
    for (const Words& words : kWords)
    {
        const std::string said = words.said;
        if (const std::size_t at = text.find(said);
            at != std::string::npos && !(has_contact && said.starts_with(": parts")))
            text.replace(at, said.size(), words.window);
    }
    return text;
}

} // namespace cellwarp
