// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/json_object.h"

#include "io/file_limits.h"
#include "io/json_text.h"

namespace cellwarp
{

namespace
{

std::int64_t line_of(const std::string& text, std::size_t byte)
{
    const std::size_t end = std::min(byte, text.size());
    return 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end),
                          '\n');
}

/// The line of a key like "rods[2].points": of what of it is there, from the root on; 0:
/// not even its first part is.
std::int64_t line_of_field(const std::string& text, std::string_view field)
{
    TextRange value = json_root(text);
    bool is_found = false;
    while (!field.empty())
    {
        const std::size_t end = std::min(field.find_first_of(".["), field.size());
        std::optional<TextRange> next;
        if (field[0] == '[')
        {
            const std::size_t close = std::min(field.find(']'), field.size());
            const std::optional<std::int64_t> number =
                parse_integer(field.substr(1, close - 1));
            if (text[value.begin] == '[')
                if (const std::vector<TextRange> items = json_items(text, value);
                    number && *number >= 0 &&
                    *number < static_cast<std::int64_t>(items.size()))
                    next = items[static_cast<std::size_t>(*number)];
            field.remove_prefix(std::min(close + 1, field.size()));
        }
        else
        {
            if (text[value.begin] == '{')
                next = json_member(text, value, field.substr(0, end));
            field.remove_prefix(end);
        }
        if (!next)
            break;
        value = *next;
        is_found = true;
        if (!field.empty() && field[0] == '.')
            field.remove_prefix(1);
    }
    return is_found ? line_of(text, value.begin) : 0;
}

} // namespace

Error JsonError::with_line(const std::string& path, const std::string& text) const
{
    return malformed({path, line_of_field(text, field_), field_}, what_);
}

Json parse_json(const std::string& path, const std::string& text)
{
    Json json;
    try
    {
        json = Json::parse(
            text,
            [&](int depth, Json::parse_event_t, Json&)
            {
                if (depth > kMaxNesting)
                    throw malformed({path, 0, ""}, "is nested deeper than 128");
                return true;
            });
    }
    catch (const Json::parse_error& error)
    {
        throw malformed({path, line_of(text, error.byte > 0 ? error.byte - 1 : 0), ""},
                        "is no JSON (byte " + std::to_string(error.byte) + ")");
    }
    catch (const Json::out_of_range&)
    {
        throw malformed({path, 0, ""}, "holds a number that is out of range");
    }
    return json;
}

} // namespace cellwarp
