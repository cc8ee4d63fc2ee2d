// SPDX-License-Identifier: GPL-3.0-or-later
// The JSON of a glTF: its values, each checked where it is asked for.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "io/base/error.h"

namespace cellwarp::core
{

/// Extensions that change what is read.
inline constexpr const char* kMeshoptExtension = "EXT_meshopt_compression";
inline constexpr const char* kDracoExtension = "KHR_draco_mesh_compression";
inline constexpr const char* kInstancingExtension = "EXT_mesh_gpu_instancing";

/// Every error is Fault::Malformed and names the file and the field.
class GltfJson
{
public:
    using Json = nlohmann::json;

    /// \p text stands at byte \p begin of the file \p path; only the text of a file that
    /// is JSON alone has lines. Checks the version and what the file requires.
    GltfJson(std::string path, std::string_view text, std::size_t begin, bool has_lines);

    const std::string& path() const { return path_; }
    const Json& root() const { return root_; }

    [[noreturn]] void fail(const std::string& field, const std::string& what) const
    {
        throw malformed({path_, 0, field}, what);
    }

    static const Json* find(const Json& object, const char* key)
    {
        const auto found = object.find(key);
        return found == object.end() ? nullptr : &*found;
    }
    /// A list of objects of the root; empty if it is not there.
    const Json& list(const char* key) const
    {
        static const Json none = Json::array();
        const Json* found = find(root_, key);
        return found ? *found : none;
    }
    std::uint64_t count_of(const Json& object, const char* key, const std::string& where,
                           std::optional<std::uint64_t> otherwise = {}) const
    {
        const Json* found = find(object, key);
        if (!found && otherwise)
            return *otherwise;
        if (!found)
            fail(where + "." + key, "is missing");
        return count_of(*found, where + "." + key);
    }
    std::uint64_t count_of(const Json& value, const std::string& where) const
    {
        if (value.is_number_unsigned())
            return value.get<std::uint64_t>();
        if (value.is_number_float() && value.get<double>() >= 0 &&
            value.get<double>() <= 9007199254740992.0 &&
            value.get<double>() == std::floor(value.get<double>()))
            return static_cast<std::uint64_t>(value.get<double>());
        fail(where, "got " + value.dump().substr(0, 40) + ", need a whole number");
    }
    /// A number of something in a list of \p size.
    std::size_t index_of(const Json& value, const std::string& where, const char* what,
                         std::size_t size) const
    {
        const std::uint64_t index = count_of(value, where);
        if (index >= size)
            fail(where, "is out of range (got " + std::to_string(index) + ", there are " +
                            std::to_string(size) + " " + what + ")");
        return static_cast<std::size_t>(index);
    }
    std::string text_of(const Json& object, const char* key,
                        const std::string& where) const
    {
        const Json* found = find(object, key);
        if (!found || !found->is_string())
            fail(where, std::string("need a text ") + key);
        return found->get<std::string>();
    }
    template <std::size_t size>
    std::optional<std::array<double, size>> numbers(const Json& object, const char* key,
                                                    const std::string& where) const
    {
        const Json* found = find(object, key);
        if (!found)
            return std::nullopt;
        std::array<double, size> values{};
        const std::string need = "need " + std::to_string(size) + " finite numbers";
        if (!found->is_array() || found->size() != size)
            fail(where + "." + key, need);
        for (std::size_t k = 0; k < size; ++k)
        {
            if (!(*found)[k].is_number() || !std::isfinite((*found)[k].get<double>()))
                fail(where + "." + key,
                     need + " (got " + (*found)[k].dump().substr(0, 40) + ")");
            values[k] = (*found)[k].get<double>();
        }
        return values;
    }
    static const Json* extension(const Json& object, const char* name)
    {
        const Json* all = find(object, "extensions");
        return all && all->is_object() ? find(*all, name) : nullptr;
    }
    bool uses(const char* extension_name) const
    {
        for (const char* key : {"extensionsUsed", "extensionsRequired"})
            if (const Json* names = find(root_, key); names && names->is_array())
                if (std::find(names->begin(), names->end(), extension_name) !=
                    names->end())
                    return true;
        return false;
    }

private:
    void check_asset() const;
    void check_lists() const;

    std::string path_;
    Json root_;
};

/// Numbers of an element of an accessor of such a type; 0: there is none.
std::size_t gltf_length(std::string_view type);

/// "meshes[3]"
std::string element(const char* list, std::size_t i);

} // namespace cellwarp::core
