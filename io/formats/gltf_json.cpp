// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/gltf_json.h"

#include <iterator>

#include "io/base/file_limits.h"
#include "io/base/json_text.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

/// Extensions that a file may require: they change no position and nothing that turns,
/// or what they change is understood.
bool is_known_extension(const std::string& name)
{
    static constexpr std::string_view prefixes[] = {
        "KHR_materials_", "KHR_texture_", "EXT_texture_",  "KHR_lights_",
        "EXT_lights_",    "KHR_xmp",      "KHR_animation_"};
    static constexpr std::string_view names[] = {
        "KHR_mesh_quantization",   "KHR_node_visibility",
        "MSFT_texture_dds",        "EXT_mesh_gpu_instancing",
        "EXT_meshopt_compression", "KHR_draco_mesh_compression"};
    return std::find(std::begin(names), std::end(names), name) != std::end(names) ||
           std::any_of(std::begin(prefixes), std::end(prefixes),
                       [&](std::string_view prefix) { return name.starts_with(prefix); });
}

} // namespace

std::size_t gltf_length(std::string_view type)
{
    static constexpr std::pair<std::string_view, std::size_t> lengths[] = {
        {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
        {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
    for (const auto& [name, length] : lengths)
        if (name == type)
            return length;
    return 0;
}

std::string element(const char* list, std::size_t i)
{
    return std::string(list) + "[" + std::to_string(i) + "]";
}

GltfJson::GltfJson(std::string path, std::string_view text, std::size_t begin,
                   bool has_lines)
    : path_(std::move(path))
{
    if (const std::size_t depth = json_depth(text); depth > kMaxNesting)
        fail("JSON", "depth: got " + std::to_string(depth) +
                         " levels of nesting, need at most 128");
    try
    {
        root_ = Json::parse(text);
    }
    catch (const Json::parse_error& error)
    {
        const std::string_view before = text.substr(0, error.byte);
        const std::int64_t line =
            !has_lines ? 0 : 1 + std::count(before.begin(), before.end(), '\n');
        throw malformed({path_, line, ""}, "is no JSON (at byte " +
                                               std::to_string(begin + error.byte) + ")");
    }
    catch (const Json::out_of_range&)
    {
        throw malformed({path_, 0, ""}, "holds a number that is out of range");
    }
    if (!root_.is_object())
        fail("", "is no glTF: need an object");
    check_asset();
    check_lists();
}

void GltfJson::check_asset() const
{
    const Json* asset = find(root_, "asset");
    if (!asset || !asset->is_object())
        fail("asset", "is missing");
    for (const char* key : {"version", "minVersion"})
    {
        if (!asset->contains(key) && std::string_view(key) != "version")
            continue;
        const std::string version = text_of(*asset, key, "asset");
        if (!version.starts_with("2."))
            fail(std::string("asset.") + key,
                 "got " + in_quotes(version) + ", need version 2.0");
    }
    const Json* required = find(root_, "extensionsRequired");
    if (!required)
        return;
    if (!required->is_array())
        fail("extensionsRequired", "need a list of names");
    for (const Json& name : *required)
        if (!name.is_string() || !is_known_extension(name.get<std::string>()))
            fail("extensionsRequired", name.dump().substr(0, 80) + " cannot be read");
}

void GltfJson::check_lists() const
{
    for (const char* key : {"scenes", "nodes", "meshes", "accessors", "bufferViews",
                            "buffers", "skins", "animations"})
        if (const Json& found = list(key);
            !found.is_array() ||
            std::any_of(found.begin(), found.end(),
                        [](const Json& e) { return !e.is_object(); }))
            fail(key, "need a list of objects");
}

} // namespace cellwarp::core
