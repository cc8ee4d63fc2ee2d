// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/gltf_memory.h"

#include <algorithm>
#include <set>
#include <string>

#include "io/base/file_limits.h"
#include "io/base/json_text.h"
#include "io/formats/gltf_json.h"

namespace cellwarp::core
{

double unpacked_gltf_bytes(std::string_view json)
{
    // Most files hold no compressed data, and are not to be parsed twice.
    const auto has = [&](std::string_view text)
    { return json.find(text) != std::string_view::npos; };
    const bool may_be_packed = has(kMeshoptExtension) || has(kDracoExtension) ||
                               has("\\u"); // or a name of them, spelled otherwise
    if (!may_be_packed || json_depth(json) > kMaxNesting)
        return 0.0;
    const GltfJson::Json root = GltfJson::Json::parse(json, nullptr, false);
    if (!root.is_object())
        return 0.0;
    const auto member = [](const GltfJson::Json& object,
                           const auto& key) -> const GltfJson::Json&
    {
        static const GltfJson::Json none;
        if (!object.is_object())
            return none;
        const auto found = object.find(key);
        return found == object.end() ? none : *found;
    };
    const auto number = [&](const GltfJson::Json& object, const char* key)
    {
        const GltfJson::Json& value = member(object, key);
        return value.is_number() ? std::max(0.0, value.get<double>()) : 0.0;
    };
    double bytes = 0.0;
    for (const GltfJson::Json& view : member(root, "bufferViews"))
    {
        const GltfJson::Json& packed =
            member(member(view, "extensions"), kMeshoptExtension);
        bytes += number(packed, "count") * number(packed, "byteStride");
    }
    const GltfJson::Json& accessors = member(root, "accessors");
    std::set<std::size_t> counted;
    const auto add = [&](const GltfJson::Json& value)
    {
        if (!value.is_number_unsigned() || value.get<std::size_t>() >= accessors.size() ||
            !counted.insert(value.get<std::size_t>()).second)
            return;
        const GltfJson::Json& accessor = accessors[value.get<std::size_t>()];
        if (!accessor.is_object() || accessor.contains("bufferView"))
            return;
        const GltfJson::Json& type = member(accessor, "type");
        const std::size_t length =
            type.is_string() ? gltf_length(type.get<std::string>()) : 0;
        const double each = number(accessor, "componentType");
        bytes += number(accessor, "count") * static_cast<double>(length) *
                 (each >= 5125   ? 4.0
                  : each >= 5122 ? 2.0
                                 : 1.0);
    };
    for (const GltfJson::Json& mesh : member(root, "meshes"))
        for (const GltfJson::Json& primitive : member(mesh, "primitives"))
        {
            const GltfJson::Json& packed =
                member(member(primitive, "extensions"), kDracoExtension);
            if (!packed.is_object())
                continue;
            add(member(primitive, "indices"));
            for (const GltfJson::Json& accessor : member(primitive, "attributes"))
                add(accessor);
        }
    return bytes;
}

} // namespace cellwarp::core
