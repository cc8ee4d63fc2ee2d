// SPDX-License-Identifier: GPL-3.0-or-later
// Reading JSON files whose keys are known. Each error and warning names the key and its
// line.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "io/base/file_limits.h"
#include "io/scene/scene_settings.h"

namespace cellwarp::core
{

using Json = nlohmann::json;

/// Ranges of many keys.
inline constexpr Between<double> kAny{-kHuge, kHuge}, kNotNegative{0.0, kHuge},
    kPositive{kTiny, kHuge}, kShare{0.0, 1.0}, kKeyTimes{-1e9, 1e9}; ///< [s]

/// A JSON file while it is read, and what is found beside its values.
struct JsonReading
{
    const std::string& path;
    const std::string& text;
    std::vector<std::string> warnings = {};     ///< with those of unknown keys
    std::vector<std::string> unknown_keys = {}; ///< remarks about them alone
    /// Keys whose values name files relative to this one: "skeleton.motion.file".
    std::vector<std::string> file_keys = {};

    /// A remark about the key \p field, from the root on: "rods[2].points".
    std::string remark(const std::string& field, const std::string& what) const;
};

/// The values of the file. Throws Fault::Malformed with the line of a syntax error; deep
/// nesting is one. If a key is in its object more than once its last value counts, and a
/// warning names the first such key.
Json parse_json(JsonReading& reading);

/// Whether each of a list of words is in a file: sets the flag beside the word.
using Flags = std::initializer_list<std::pair<const char*, bool*>>;

/// Reads the keys of one JSON object. Each read() leaves its output as it is if the key
/// is missing, and returns whether it is there; it fails if the value is not allowed.
class JsonObject
{
public:
    /// \p name: of the object, from the root on; empty: the root. \p json and \p reading
    /// must outlive it.
    JsonObject(const Json& json, JsonReading& reading, std::string name);

    const Json* find(const std::string& key); ///< null: missing
    /// \p key, or its old name if only that is there, with a warning that names the new
    /// one.
    std::string renamed(const std::string& key, const std::string& old);
    bool read(const std::string& key, std::string& out);
    bool read(const std::string& key, const OneOf& allowed, std::string& out);
    bool read(const std::string& key, const Between<std::int64_t>& allowed,
              std::int64_t& out);
    bool read(const std::string& key, const Between<double>& allowed, double& out);
    bool read(const std::string& key, YesOrNo, bool& out);
    bool read(const std::string& key, bool& out) { return read(key, YesOrNo{}, out); }
    /// A list of words.
    bool read(const std::string& key, const Flags& out);
    /// \p most: the largest size of a number.
    template <std::size_t count>
    bool read(const std::string& key, std::array<double, count>& out, double most = kHuge)
    {
        const Json* const value = find(key);
        if (value)
            read_numbers(key, *value, most, out.data(), count);
        return value;
    }
    bool read(const std::string& key, Eigen::Vector3d& out);
    /// A list of points.
    template <class Point>
    bool read(const std::string& key, std::vector<Point>& out, double most = kHuge)
    {
        constexpr std::size_t kMostPoints = 10'000'000;
        return read_list(key,
                         [&](const Json& value, const std::string& item)
                         {
                             if (out.size() == kMostPoints)
                                 fail(key, "more than 10000000 points");
                             read_numbers(item, value, most, out.emplace_back().data(),
                                          3);
                         });
    }
    template <class Value>
    bool read(const std::string& key, std::optional<Value>& out)
    {
        Value value{};
        const bool is_there = read(key, value);
        if (is_there)
            out = std::move(value);
        return is_there;
    }
    template <class Allowed, class Value>
    bool read(const std::string& key, const Allowed& allowed, std::optional<Value>& out)
    {
        Value value{};
        const bool is_there = read(key, allowed, value);
        if (is_there)
            out = std::move(value);
        return is_there;
    }
    /// A name of a file, resolved against this one.
    bool read_file_name(const std::string& key, std::string& out);
    /// Calls \p read with the object of the key, and warns of the keys that it has not
    /// asked for.
    template <class Read>
    bool read_object(const std::string& key, Read&& read)
    {
        const Json* const value = find(key);
        if (value)
            read_whole(*value, name_of(key), read);
        return value;
    }
    /// Calls \p read with each value of a list and its key: "points[3]".
    template <class Read>
    bool read_list(const std::string& key, Read&& read)
    {
        const Json* const list = find(key);
        if (list && !list->is_array())
            fail(key, "need a list");
        for (std::size_t k = 0; list && k < list->size(); ++k)
            read((*list)[k], key + "[" + std::to_string(k) + "]");
        return list;
    }
    /// The same for a list of objects, as read_object() does.
    template <class Read>
    bool read_objects(const std::string& key, Read&& read)
    {
        return read_list(key, [&](const Json& value, const std::string& item)
                         { read_whole(value, name_of(item), read); });
    }
    template <class... Arguments>
    void need(const std::string& key, Arguments&&... arguments)
    {
        if (!read(key, std::forward<Arguments>(arguments)...))
            fail(key, "is missing");
    }

    const std::string& name() const { return name_; }
    std::string name_of(const std::string& key) const;
    JsonReading& reading() { return reading_; }
    /// Keys that were asked for so far, in their order.
    const std::vector<std::string>& known() const { return known_; }
    /// Remarks about the keys that are there and not empty, of those that known() has
    /// from \p first on.
    std::vector<std::string> left_out(std::size_t first, const std::string& why) const;
    void warn(const std::string& key, const std::string& what);
    void warn_of_the_rest();
    /// An empty key names the object itself.
    [[noreturn]] void fail(const std::string& key, const std::string& what) const;

private:
    void read_numbers(const std::string& key, const Json& value, double most, double* out,
                      std::size_t count) const;
    template <class Read>
    void read_whole(const Json& value, const std::string& name, Read& read)
    {
        JsonObject object(value, reading_, name);
        read(object);
        object.warn_of_the_rest();
    }

    const Json& json_;
    JsonReading& reading_;
    std::string name_;
    std::vector<std::string> known_;
};

} // namespace cellwarp::core
