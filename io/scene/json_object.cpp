// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/json_object.h"

#include <set>

#include "io/base/file_limits.h"
#include "io/base/json_text.h"

namespace cellwarp::core
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

/// The keys of the objects that are open while a text is read, from the root on.
class KeysInUse
{
public:
    /// The place of a key that its object has already, like "rods[2].points"; else empty.
    std::string follow(Json::parse_event_t event, const Json& value)
    {
        using Event = Json::parse_event_t;
        switch (event)
        {
        case Event::object_start:
        case Event::array_start:
            begin_value();
            open_.push_back({event == Event::array_start, {}, {}, 0});
            break;
        case Event::object_end:
        case Event::array_end:
            open_.pop_back();
            break;
        case Event::value:
            begin_value();
            break;
        case Event::key:
            open_.back().key = value.get<std::string>();
            if (!open_.back().keys.insert(open_.back().key).second)
                return place();
            break;
        }
        return {};
    }

private:
    struct Open
    {
        bool is_array;
        std::set<std::string> keys;
        std::string key;     ///< the last one
        std::size_t num = 0; ///< of an array's items so far
    };
    void begin_value()
    {
        if (!open_.empty())
            ++open_.back().num;
    }
    std::string place() const
    {
        std::string text;
        for (const Open& open : open_)
            if (open.is_array)
                text += "[" + std::to_string(open.num - 1) + "]";
            else
                text += (text.empty() ? "" : ".") + open.key;
        return text;
    }

    std::vector<Open> open_;
};

} // namespace

Error JsonError::with_line(const std::string& path, const std::string& text) const
{
    return malformed({path, line_of_field(text, field_), field_}, what_);
}

Json parse_json(const std::string& path, const std::string& text,
                std::vector<std::string>* warnings)
{
    Json json;
    KeysInUse keys;
    std::string twice;
    try
    {
        json = Json::parse(
            text,
            [&](int depth, Json::parse_event_t event, Json& value)
            {
                if (depth > kMaxNesting)
                    throw malformed({path, 0, ""}, "is nested deeper than 128");
                if (twice.empty())
                    twice = keys.follow(event, value);
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
    if (warnings && !twice.empty())
        warnings->push_back(at({path, line_of_field(text, twice), twice},
                               "is in its object more than once: the last value counts"));
    return json;
}

} // namespace cellwarp::core
