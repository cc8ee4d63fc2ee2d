// SPDX-License-Identifier: GPL-3.0-or-later
// Writing: numbers go back from the world to the space of their node and into the
// buffers, then the buffers into what packs them. Of the JSON only bounds, data URIs and
// names of buffers change.
#include "io/gltf.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <utility>

#include <Eigen/LU>

#include "io/base64.h"
#include "io/error.h"
#include "io/number.h"
#include "io/packed.h"
#include "io/stored_number.h"

namespace cellwarp
{

namespace
{

namespace fs = std::filesystem;
using Kind = GltfLayout::Buffer::Kind;

/// What takes the place of a part of the JSON.
struct Replacement
{
    TextRange range;
    std::string text;
};

/// The vectors as the buffers have them.
std::vector<Eigen::Vector3d> stored_vectors(const ByteOffsets& places,
                                            const std::string& body)
{
    std::vector<Eigen::Vector3d> vectors(places.starts.size() / 3);
    for (std::size_t i = 0; i < places.starts.size(); ++i)
        vectors[i / 3][static_cast<Eigen::Index>(i % 3)] =
            load_stored(body.data() + places.starts[i], Scalar::Float32, false);
    return vectors;
}

/// Puts the vectors of a list that change into the body: \p to_node takes a vector of
/// the world into the space of its part.
template <class ToNode>
void patch_vectors(const GeometryFile& file, int list, const ByteOffsets& places,
                   const std::vector<Eigen::Vector3d>& before,
                   const std::vector<Eigen::Vector3d>& after, ToNode&& to_node,
                   std::string& body)
{
    if (after.empty())
        return;
    const std::vector<Eigen::Vector3d> stored = stored_vectors(places, body);
    std::vector<Eigen::Vector3d> local = stored;
    for (const GltfLayout::Part& part : file.gltf->parts)
    {
        const GltfToNode map(part);
        for (std::size_t i = part.first[list]; i < part.end[list]; ++i)
            if (after[i] != before[i])
                local[i] = to_node(map, after[i]);
    }
    overwrite_changed(places, numbers_of(stored), numbers_of(local), file.path, body);
}

Eigen::Vector3d with_length_of(const Eigen::Vector3d& vector,
                               const Eigen::Vector3d& other)
{
    const double length = vector.norm();
    return length > 0 ? Eigen::Vector3d(vector * (other.norm() / length)) : vector;
}

void patch_body(const GeometryFile& file, const DeformedSamples& patch, std::string& body)
{
    const Geometry& geometry = file.geometry;
    patch_vectors(
        file, 0, geometry.sample_places, geometry.samples, patch.samples,
        [](const GltfToNode& map, const Eigen::Vector3d& x) { return map.sample(x); },
        body);
    patch_vectors(
        file, 1, geometry.direction_places, geometry.directions, patch.directions,
        [](const GltfToNode& map, const Eigen::Vector3d& n) { return map.direction(n); },
        body);
    patch_vectors(
        file, 2, geometry.tangent_places, geometry.tangents, patch.tangents,
        [](const GltfToNode& map, const Eigen::Vector3d& t) { return map.tangent(t); },
        body);
}

/// Whether some element of an accessor has changed.
bool has_changed(const GltfLayout::Data& data, std::string_view before,
                 std::string_view after)
{
    const std::size_t size = data.length * sizeof(float);
    for (std::uint64_t i = 0; i < data.count; ++i)
    {
        const std::uint64_t start = data.start + i * data.stride;
        if (before.substr(start, size) != after.substr(start, size))
            return true;
    }
    return false;
}

void replace_bounds(std::string_view json, TextRange accessor, const GltfBounds& found,
                    std::vector<Replacement>& out)
{
    for (const auto& [key, bounds] :
         {std::pair("min", found.least()), std::pair("max", found.most())})
    {
        const std::optional<TextRange> array = json_member(json, accessor, key);
        if (!array)
            continue;
        const std::vector<TextRange> items = json_items(json, *array);
        for (std::size_t k = 0; k < std::min(items.size(), bounds.size()); ++k)
        {
            const std::optional<double> old =
                parse_double(json.substr(items[k].begin, items[k].end - items[k].begin));
            // Written with fewer digits it is still the same number of the buffer.
            if (!old || static_cast<float>(*old) != static_cast<float>(bounds[k]))
                out.push_back({items[k], shortest(bounds[k])});
        }
    }
}

/// A name as a URI.
std::string percent_encoded(std::string_view name)
{
    static constexpr std::string_view digits = "0123456789ABCDEF";
    std::string uri;
    for (const char c : name)
    {
        const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                              (c >= '0' && c <= '9') || c == '-' || c == '.' ||
                              c == '_' || c == '~';
        if (is_plain)
            uri += c;
        else
        {
            uri += '%';
            uri += digits[static_cast<unsigned char>(c) >> 4];
            uri += digits[static_cast<unsigned char>(c) & 15];
        }
    }
    return uri;
}

std::size_t num_beside(const GltfLayout& layout)
{
    return static_cast<std::size_t>(std::count_if(
        layout.buffers.begin(), layout.buffers.end(),
        [](const GltfLayout::Buffer& buffer) { return buffer.kind == Kind::Beside; }));
}

/// The file with another JSON, and \p body in its binary chunk.
std::string assembled(const GeometryFile& file, const std::string& json,
                      const std::string& body)
{
    if (file.geometry.format != "glb")
        return json;
    const GltfLayout& layout = *file.gltf;
    const std::string_view bytes = file.bytes;
    std::string out = glb_head(bytes, layout.json, json.size());
    out += json;
    const std::size_t chunk = out.size() + layout.chunk_start - layout.json.end;
    out += bytes.substr(layout.json.end);
    if (layout.chunk_start > 0 && !layout.buffers.empty() &&
        layout.buffers[0].kind == Kind::Chunk)
        out.replace(chunk, layout.buffers[0].size, body, layout.buffers[0].start,
                    layout.buffers[0].size);
    return out;
}

} // namespace

GltfToNode::GltfToNode(const GltfLayout::Part& part)
    : is_in_place_(part.is_in_place()), linear_(part.to_world.linear()),
      inverse_(linear_.inverse()), shift_(part.to_world.translation())
{
}

Eigen::Vector3d GltfToNode::sample(const Eigen::Vector3d& x) const
{
    return is_in_place_ ? x : Eigen::Vector3d(inverse_ * (x - shift_));
}

Eigen::Vector3d GltfToNode::direction(const Eigen::Vector3d& n) const
{
    return is_in_place_ ? n : with_length_of(linear_.transpose() * n, n);
}

Eigen::Vector3d GltfToNode::tangent(const Eigen::Vector3d& t) const
{
    return is_in_place_ ? t : with_length_of(inverse_ * t, t);
}

GltfBounds::GltfBounds(const GltfLayout::Data& data)
    : accessor_(data.accessor),
      least_(data.length, std::numeric_limits<double>::infinity()), minus_most_(least_)
{
}

void GltfBounds::add(const char* element)
{
    for (std::size_t k = 0; k < least_.size(); ++k)
    {
        const double value =
            load_stored(element + k * sizeof(float), Scalar::Float32, false);
        least_[k] = std::min(least_[k], value);
        minus_most_[k] = std::min(minus_most_[k], -value);
    }
}

std::vector<double> GltfBounds::most() const
{
    std::vector<double> most = minus_most_;
    for (double& bound : most)
        bound = -bound;
    return most;
}

std::string patched_json(std::string_view json, const GltfLayout& layout,
                         const std::vector<GltfBounds>& bounds,
                         const std::vector<std::string>& uris, bool is_binary)
{
    const TextRange root = json_root(json);
    const auto items = [&](const char* key)
    {
        const std::optional<TextRange> array = json_member(json, root, key);
        return array ? json_items(json, *array) : std::vector<TextRange>();
    };
    std::vector<Replacement> replacements;
    const std::vector<TextRange> accessors = items("accessors"),
                                 buffers = items("buffers");
    for (const GltfBounds& found : bounds)
        replace_bounds(json, accessors[found.accessor()], found, replacements);
    for (std::size_t i = 0; i < layout.buffers.size(); ++i)
        if (uris[i] != layout.buffers[i].uri)
            replacements.push_back(
                {*json_member(json, buffers[i], "uri"), "\"" + uris[i] + "\""});
    std::sort(replacements.begin(), replacements.end(),
              [](const Replacement& a, const Replacement& b)
              { return a.range.begin < b.range.begin; });
    std::string out;
    std::size_t copied = 0;
    for (const Replacement& replacement : replacements)
    {
        out += json.substr(copied, replacement.range.begin - copied);
        out += replacement.text;
        copied = replacement.range.end;
    }
    out += json.substr(copied);
    // Chunks are padded to whole words.
    if (is_binary && out.size() != json.size())
        out.resize((out.size() + 3) / 4 * 4, ' ');
    return out;
}

std::string glb_head(std::string_view bytes, TextRange old_json, std::size_t json_bytes)
{
    const auto word = [](std::size_t value)
    {
        std::string text;
        store(static_cast<double>(value), Scalar::UInt32, false, text);
        return text;
    };
    std::uint32_t length;
    std::memcpy(&length, bytes.data() + 8, sizeof length);
    std::string out(bytes.substr(0, 8));
    out += word(length - (old_json.end - old_json.begin) + json_bytes);
    out += word(json_bytes);
    out += bytes.substr(16, old_json.begin - 16);
    return out;
}

std::string uri_of(const std::string& path)
{
    return percent_encoded(fs::path(path).filename().string());
}

std::string uri_again(const GltfLayout& layout, const std::vector<std::string>& uris,
                      const GltfLayout::Buffer& buffer)
{
    const bool has_moved = uris[buffer.twin] != layout.buffers[buffer.twin].uri;
    return has_moved ? uris[buffer.twin] : buffer.uri;
}

std::string patched_data_uri(const std::string& uri, std::string_view before,
                             std::string_view after)
{
    const std::size_t data = uri.find(',') + 1;
    return uri.substr(0, data) + base64_patched(uri.substr(data), before, after);
}

std::vector<std::string> companion_paths(const GltfLayout& layout,
                                         const std::string& output)
{
    const fs::path path(output);
    const bool is_one = num_beside(layout) == 1;
    std::vector<std::string> paths;
    for (std::size_t i = 0; i < layout.buffers.size(); ++i)
        if (layout.buffers[i].kind == Kind::Beside)
            paths.push_back(
                (path.parent_path() / (path.stem().string() +
                                       (is_one ? "" : "-" + std::to_string(i)) + ".bin"))
                    .string());
    return paths;
}

PatchedGltf patched_gltf(const GeometryFile& file, const DeformedSamples& patch,
                         const std::string& output)
{
    const Geometry& geometry = file.geometry;
    const GltfLayout& layout = *file.gltf;
    std::string body = geometry.unpacked;
    if (geometry.not_writable.empty())
        patch_body(file, patch, body);
    else if (patch.samples != geometry.samples)
        throw malformed({file.path, 0, ""},
                        "cannot be written: " + geometry.not_writable);
    const bool has_names = !output.empty() && num_beside(layout) > 0;
    if (body == geometry.unpacked && !has_names)
        return {file.bytes, {}};

    std::vector<GltfBounds> bounds;
    for (const GltfLayout::Data& data : layout.data)
        if (has_changed(data, geometry.unpacked, body))
        {
            GltfBounds& found = bounds.emplace_back(data);
            for (std::uint64_t i = 0; i < data.count; ++i)
                found.add(body.data() + data.start + i * data.stride);
        }

    PatchedGltf result;
    const std::vector<std::string> paths =
        has_names ? companion_paths(layout, output) : std::vector<std::string>();
    std::vector<std::string> uris;
    for (const GltfLayout::Buffer& buffer : layout.buffers)
    {
        const std::string_view before =
            std::string_view(geometry.unpacked).substr(buffer.start, buffer.size);
        const std::string_view after =
            std::string_view(body).substr(buffer.start, buffer.size);
        uris.push_back(buffer.uri);
        if (buffer.kind == Kind::Inside && before != after)
            uris.back() = patched_data_uri(buffer.uri, before, after);
        if (buffer.kind == Kind::Beside && has_names)
        {
            const std::string& path = paths[result.companions.size()];
            uris.back() = uri_of(path);
            result.companions.push_back({path, std::string(after)});
        }
        if (buffer.kind == Kind::Again)
            uris.back() = uri_again(layout, uris, buffer);
    }
    const std::string json =
        patched_json(std::string_view(file.bytes)
                         .substr(layout.json.begin, layout.json.end - layout.json.begin),
                     layout, bounds, uris, geometry.format == "glb");
    result.bytes = assembled(file, json, body);
    return result;
}

} // namespace cellwarp
