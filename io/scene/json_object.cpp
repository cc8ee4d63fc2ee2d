// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/json_object.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>

#include "io/base/error.h"
#include "io/base/file_limits.h"
#include "io/base/json_text.h"
#include "io/base/near_word.h"
#include "io/base/number.h"
#include "io/base/relative_name.h"

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

/// The line of a key like "rods[2].points": of the longest part of it that is there, from
/// the root on; 0: not even its first part is.
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

std::string JsonReading::remark(const std::string& field, const std::string& what) const
{
    return at({path, line_of_field(text, field), field}, what);
}

Json parse_json(JsonReading& reading)
{
    Json json;
    KeysInUse keys;
    std::string twice;
    try
    {
        json = Json::parse(
            reading.text,
            [&](int depth, Json::parse_event_t event, Json& value)
            {
                if (depth > kMaxNesting)
                    throw malformed({reading.path, 0, ""}, "is nested deeper than 128");
                if (twice.empty())
                    twice = keys.follow(event, value);
                return true;
            });
    }
    catch (const Json::parse_error& error)
    {
        throw malformed({reading.path,
                         line_of(reading.text, error.byte > 0 ? error.byte - 1 : 0), ""},
                        "is no JSON (byte " + std::to_string(error.byte) + ")");
    }
    catch (const Json::out_of_range&)
    {
        throw malformed({reading.path, 0, ""}, "holds a number that is out of range");
    }
    if (!twice.empty())
        reading.warnings.push_back(reading.remark(
            twice, "is in its object more than once: the last value counts"));
    return json;
}

JsonObject::JsonObject(const Json& json, JsonReading& reading, std::string name)
    : json_(json), reading_(reading), name_(std::move(name))
{
    if (!json.is_object())
        fail("", "need an object");
}

const Json* JsonObject::find(const std::string& key)
{
    known_.push_back(key);
    const auto found = json_.find(key);
    return found == json_.end() ? nullptr : &*found;
}

std::string JsonObject::renamed(const std::string& key, const std::string& old)
{
    if (!json_.contains(old))
        return key;
    if (find(key))
        fail(old, "is the old name of " + name_of(key) + ", which is there as well");
    warn(old, "is called " + name_of(key) + " now");
    return old;
}

bool JsonObject::read(const std::string& key, std::string& out)
{
    const Json* const value = find(key);
    if (value && !value->is_string())
        fail(key, "need a text");
    if (value)
        out = value->get<std::string>();
    return value;
}

bool JsonObject::read(const std::string& key, const OneOf& allowed, std::string& out)
{
    if (!read(key, out))
        return false;
    std::string words;
    for (const char* word : allowed.words)
        words += (words.empty() ? "" : ", ") + std::string(word);
    if (!allowed.has(out))
        fail(key, "got " + in_quotes(out) + ", need one of " + words);
    return true;
}

bool JsonObject::read(const std::string& key, const Between<std::int64_t>& allowed,
                      std::int64_t& out)
{
    const Json* const value = find(key);
    if (!value)
        return false;
    if (!value->is_number_integer() ||
        value->get<double>() < static_cast<double>(allowed.low) ||
        value->get<double>() > static_cast<double>(allowed.high))
        fail(key, "got " + value->dump().substr(0, 40) + ", need an integer from " +
                      std::to_string(allowed.low) + " to " +
                      std::to_string(allowed.high));
    out = value->get<std::int64_t>();
    return true;
}

bool JsonObject::read(const std::string& key, const Between<double>& allowed, double& out)
{
    const Json* const value = find(key);
    if (!value)
        return false;
    if (!value->is_number() || !(value->get<double>() >= allowed.low) ||
        !(value->get<double>() <= allowed.high))
        fail(key, "got " + value->dump().substr(0, 40) + ", need a number from " +
                      shortest(allowed.low) + " to " + shortest(allowed.high));
    out = value->get<double>();
    return true;
}

bool JsonObject::read(const std::string& key, YesOrNo, bool& out)
{
    const Json* const value = find(key);
    if (value && !value->is_boolean())
        fail(key, "got " + value->dump().substr(0, 40) + ", need true or false");
    if (value)
        out = value->get<bool>();
    return value;
}

bool JsonObject::read(const std::string& key, const Flags& out)
{
    std::string words;
    for (const auto& [word, flag] : out)
        words += (words.empty() ? "" : ", ") + std::string(word);
    return read_list(key,
                     [&](const Json& value, const std::string& item)
                     {
                         const auto found = std::find_if(out.begin(), out.end(),
                                                         [&](const auto& one)
                                                         { return value == one.first; });
                         if (found == out.end())
                             fail(item, "need one of " + words);
                         *found->second = true;
                     });
}

bool JsonObject::read(const std::string& key, Eigen::Vector3d& out)
{
    const Json* const value = find(key);
    if (value)
        read_numbers(key, *value, kHuge, out.data(), 3);
    return value;
}

bool JsonObject::read_file_name(const std::string& key, std::string& out)
{
    if (!read(key, out))
        return false;
    if (out.empty())
        fail(key, "need the name of a file");
    out = resolved_name(reading_.path, out);
    reading_.file_keys.push_back(name_of(key));
    return true;
}

std::string JsonObject::name_of(const std::string& key) const
{
    return name_.empty() || key.empty() ? name_ + key : name_ + "." + key;
}

std::vector<std::string> JsonObject::left_out(std::size_t first,
                                              const std::string& why) const
{
    std::vector<std::string> out;
    for (const auto& [key, value] : json_.items())
        if (!value.empty() &&
            std::find(known_.begin() + static_cast<std::ptrdiff_t>(first), known_.end(),
                      key) != known_.end())
            out.push_back(reading_.remark(name_of(key), why));
    return out;
}

void JsonObject::warn(const std::string& key, const std::string& what)
{
    reading_.warnings.push_back(reading_.remark(name_of(key), what));
}

void JsonObject::warn_of_the_rest()
{
    for (const auto& [key, value] : json_.items())
        if (std::find(known_.begin(), known_.end(), key) == known_.end())
        {
            const std::string near = nearest_word(key, known_);
            const std::string what =
                near.empty() ? "unknown key" : "unknown key (near " + near + ")";
            warn(key, what + ", ignored");
            reading_.unknown_keys.push_back(reading_.remark(name_of(key), what));
        }
}

void JsonObject::fail(const std::string& key, const std::string& what) const
{
    const std::string field = name_of(key);
    throw malformed({reading_.path, line_of_field(reading_.text, field), field}, what);
}

void JsonObject::read_numbers(const std::string& key, const Json& value, double most,
                              double* out, std::size_t count) const
{
    const std::string many = count == 3 ? "three" : std::to_string(count);
    if (!value.is_array() || value.size() != count)
        fail(key, "need " + many + " numbers");
    for (std::size_t k = 0; k < count; ++k)
    {
        if (!value[k].is_number() || !std::isfinite(value[k].get<double>()))
            fail(key, "need " + many + " finite numbers");
        out[k] = value[k].get<double>();
        if (std::abs(out[k]) > most)
            fail(key, "is beyond 1e30");
    }
}

} // namespace cellwarp::core
