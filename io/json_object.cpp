// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/json_object.h"

#include "io/file_limits.h"

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

} // namespace

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
