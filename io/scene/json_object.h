// SPDX-License-Identifier: GPL-3.0-or-later
// Reading JSON files whose keys are known: what is wrong is told by its place.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/scene/scene_settings.h"

namespace cellwarp::core
{

using Json = nlohmann::json;

/// Throws Fault::Malformed with the line of a syntax error; deep nesting is one. The last
/// of several values of one key counts; \p warnings, if there are any, name the first
/// such key.
Json parse_json(const std::string& path, const std::string& text,
                std::vector<std::string>* warnings = nullptr);

/// A wrong value, told by its key from the root on: "rods[2].points". Where it stands in
/// the text is not known yet: with_lines() finds it.
class JsonError : public Error
{
public:
    JsonError(const std::string& path, std::string field, std::string what)
        : Error(malformed({path, 0, field}, what)), field_(std::move(field)),
          what_(std::move(what))
    {
    }
    /// With the line in \p text, the file's.
    Error with_line(const std::string& path, const std::string& text) const;

private:
    std::string field_, what_;
};

/// What \p read() returns, which reads JSON \p text: what is wrong there is told with its
/// line.
template <class Read>
auto with_lines(const std::string& path, const std::string& text, const Read& read)
{
    try
    {
        return read();
    }
    catch (const JsonError& error)
    {
        throw error.with_line(path, text);
    }
}

/// Reads the keys of one JSON object and complains about the others.
class JsonObject
{
public:
    /// \p prefix of its keys in messages: "cells.". All but \p prefix must outlive it.
    JsonObject(const Json& json, const std::string& path, std::string prefix,
               std::vector<std::string>& warnings)
        : json_(json), path_(path), prefix_(std::move(prefix)), warnings_(warnings)
    {
        if (!json.is_object())
            fail("", "need an object");
    }

    const Json* find(const std::string& key)
    {
        known_.push_back(key);
        const auto found = json_.find(key);
        return found == json_.end() ? nullptr : &*found;
    }
    void read(const std::string& key, std::optional<std::string>& out)
    {
        const Json* value = find(key);
        if (!value)
            return;
        if (!value->is_string())
            fail(key, "need a text");
        out = value->get<std::string>();
    }
    void read(const std::string& key, const OneOf& allowed,
              std::optional<std::string>& out)
    {
        read(key, out);
        if (!out || allowed.has(*out))
            return;
        std::string words;
        for (const char* word : allowed.words)
            words += (words.empty() ? "" : ", ") + std::string(word);
        fail(key, "got " + in_quotes(*out) + ", need one of " + words);
    }
    void read(const std::string& key, const Between<std::int64_t>& allowed,
              std::optional<std::int64_t>& out)
    {
        const Json* value = find(key);
        if (!value)
            return;
        if (!value->is_number_integer() ||
            value->get<double>() < static_cast<double>(allowed.low) ||
            value->get<double>() > static_cast<double>(allowed.high))
            fail(key, "got " + value->dump().substr(0, 40) + ", need an integer from " +
                          std::to_string(allowed.low) + " to " +
                          std::to_string(allowed.high));
        out = value->get<std::int64_t>();
    }
    void read(const std::string& key, const Between<double>& allowed,
              std::optional<double>& out)
    {
        const Json* value = find(key);
        if (!value)
            return;
        if (!value->is_number() || !(value->get<double>() >= allowed.low) ||
            !(value->get<double>() <= allowed.high))
            fail(key, "got " + value->dump().substr(0, 40) + ", need a number from " +
                          shortest(allowed.low) + " to " + shortest(allowed.high));
        out = value->get<double>();
    }
    void read(const std::string& key, YesOrNo, std::optional<bool>& out)
    {
        const Json* value = find(key);
        if (!value)
            return;
        if (!value->is_boolean())
            fail(key, "got " + value->dump().substr(0, 40) + ", need true or false");
        out = value->get<bool>();
    }
    std::array<double, 3> vector(const std::string& key, const Json& value) const
    {
        std::array<double, 3> out{};
        if (!value.is_array() || value.size() != 3)
            fail(key, "need three numbers");
        for (std::size_t k = 0; k < 3; ++k)
        {
            if (!value[k].is_number() || !std::isfinite(value[k].get<double>()))
                fail(key, "need three finite numbers");
            out[k] = value[k].get<double>();
        }
        return out;
    }
    void warn_of_the_rest() const
    {
        for (const auto& [key, value] : json_.items())
            if (std::find(known_.begin(), known_.end(), key) == known_.end())
                warnings_.push_back(
                    at({path_, 0, prefix_ + key}, "unknown key, ignored"));
    }
    [[noreturn]] void fail(const std::string& key, const std::string& what) const
    {
        // The object itself, without the dot of what would follow.
        const bool is_whole = key.empty() && !prefix_.empty();
        throw JsonError(path_,
                        is_whole ? prefix_.substr(0, prefix_.size() - 1) : prefix_ + key,
                        what);
    }

private:
    const Json& json_;
    const std::string& path_;
    std::string prefix_;
    std::vector<std::string>& warnings_;
    std::vector<std::string> known_;
};

} // namespace cellwarp::core
