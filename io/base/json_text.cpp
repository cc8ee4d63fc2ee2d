// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/json_text.h"

#include <algorithm>

#include "io/base/text.h"

namespace cellwarp::core
{

namespace
{

bool is_space(char c)
{
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

std::size_t after_space(std::string_view text, std::size_t at)
{
    while (at < text.size() && is_space(text[at]))
        ++at;
    return at;
}

/// One past the string that begins at \p at with its quote.
std::size_t string_end(std::string_view text, std::size_t at)
{
    for (++at; at < text.size() && text[at] != '"'; ++at)
        if (text[at] == '\\')
            ++at;
    return std::min(at + 1, text.size());
}

/// One past the value that begins at \p at.
std::size_t value_end(std::string_view text, std::size_t at)
{
    std::size_t depth = 0;
    while (at < text.size())
    {
        const char c = text[at];
        if (depth == 0 && (c == ',' || c == ']' || c == '}' || is_space(c)))
            return at;
        if (c == '"')
            at = string_end(text, at);
        else
        {
            depth += c == '[' || c == '{' ? 1 : 0;
            depth -= c == ']' || c == '}' ? 1 : 0;
            ++at;
        }
        if (depth == 0 && (c == '"' || c == ']' || c == '}'))
            return at;
    }
    return at;
}

/// A key as it is meant: \u0041 and the like stand for ASCII too.
std::string unescaped(std::string_view raw)
{
    std::string name;
    for (std::size_t i = 0; i < raw.size(); ++i)
    {
        if (raw[i] == '\\' && i + 5 < raw.size() && raw.substr(i + 1, 3) == "u00")
        {
            const auto digit = [](char c)
            { return c <= '9' ? c - '0' : (c | 32) - 'a' + 10; };
            name += static_cast<char>(16 * digit(raw[i + 4]) + digit(raw[i + 5]));
            i += 5;
        }
        else
            name += raw[i];
    }
    return name;
}

} // namespace

std::size_t json_depth(std::string_view text)
{
    std::size_t depth = 0, deepest = 0;
    for (std::size_t at = 0; at < text.size();)
    {
        const char c = text[at];
        if (c == '"')
        {
            at = string_end(text, at);
            continue;
        }
        if (c == '[' || c == '{')
            deepest = std::max(deepest, ++depth);
        else if ((c == ']' || c == '}') && depth > 0)
            --depth;
        ++at;
    }
    return deepest;
}

TextRange json_root(std::string_view text)
{
    const std::size_t begin = after_space(text, byte_order_mark(text));
    return {begin, value_end(text, begin)};
}

std::optional<TextRange> json_member(std::string_view text, TextRange object,
                                     std::string_view name)
{
    std::optional<TextRange> found;
    std::size_t at = after_space(text, object.begin + 1);
    while (at < object.end && text[at] == '"')
    {
        const std::size_t key_end = string_end(text, at);
        const std::string key = unescaped(text.substr(at + 1, key_end - at - 2));
        // Over the colon.
        const std::size_t begin = after_space(text, after_space(text, key_end) + 1);
        const std::size_t end = value_end(text, begin);
        if (key == name)
            found = TextRange{begin, end};
        at = after_space(text, end);
        if (at < object.end && text[at] == ',')
            at = after_space(text, at + 1);
    }
    return found;
}

std::vector<TextRange> json_items(std::string_view text, TextRange array)
{
    std::vector<TextRange> items;
    std::size_t at = after_space(text, array.begin + 1);
    while (at + 1 < array.end)
    {
        const std::size_t end = value_end(text, at);
        items.push_back({at, end});
        at = after_space(text, after_space(text, end) + 1);
    }
    return items;
}

} // namespace cellwarp::core
