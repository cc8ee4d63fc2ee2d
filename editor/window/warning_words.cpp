// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/warning_words.h"

#include <algorithm>
#include <cctype>
#include <string_view>
#include <type_traits>
#include <vector>

#include "editor/document/document.h"
#include "io/base/text.h"
#include "io/scene/scene_settings.h"

namespace cellwarp::core
{

namespace
{

/// Words of the command line, and those of the window for the same.
struct Words
{
    std::string said, window;
};

/// Longer ones first: "--fill" is part of "--fill solid".
std::vector<Words> all_words()
{
    std::vector<Words> all = {
        {"'about border' turns it there", "Shift+V turns it there"}};
    const auto add =
        [&](const std::string& said, const SettingText& text, const char* name)
    {
        std::string window = text.label;
        if (name)
            window += std::string(": ") + name;
        if (std::string_view(text.label).find(' ') != std::string_view::npos)
            window = in_quotes(window);
        all.push_back({said, window + " (under Cells)"});
    };
    const SceneSettings none;
    visit_settings(
        [&](const SettingText& text, const auto& allowed, const auto&, const auto&)
        {
            if (text.section != std::string_view("cells"))
                return;
            if constexpr (std::is_same_v<decltype(allowed), const OneOf&>)
                for (std::size_t k = 0; k < allowed.words.size(); ++k)
                    add(text.flag() + " " + allowed.words.begin()[k], text,
                        text.names[k]);
            if (*text.help_of_no != 0)
                add(text.flag("--no-"), text, text.names[1]);
            add(text.flag(), text, nullptr);
        },
        none);
    std::stable_sort(all.begin(), all.end(),
                     [](const Words& a, const Words& b)
                     { return a.said.size() > b.said.size(); });
    return all;
}
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
    static const std::vector<Words> kWords = all_words();
    for (const auto& [said, window] : kWords)
    {
        for (std::size_t at = text.find(said); at != std::string::npos;
             at = text.find(said, at + window.size()))
            text.replace(at, said.size(), window);
    }
    if (text.ends_with(kPassing) && !document.settings().cells.contact.value_or(false))
        text += kContact;
    return text;
}

} // namespace cellwarp::core
