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
std::vector<Eigen::Vector3d> stored_vectors(const Places& places, const std::string& body)
{
    std::vector<Eigen::Vector3d> vectors(places.starts.size() / 3);
    for (std::size_t i = 0; i < places.starts.size(); ++i)
        vectors[i / 3][static_cast<Eigen::Index>(i % 3)] =
            load_stored(body.data() + places.starts[i], Scalar::Float32, false);
    return vectors;
}

/// Puts the vectors of a list that change into the body: \p to_local takes a vector of
/// the world into the space of its part.
template <class ToLocal>
void patch_vectors(const GeometryFile& file, int list, const Places& places,
                   const std::vector<Eigen::Vector3d>& before,
                   const std::vector<Eigen::Vector3d>& after, ToLocal&& to_local,
                   std::string& body)
{
    if (after.empty())
        return;
    const std::vector<Eigen::Vector3d> stored = stored_vectors(places, body);
    std::vector<Eigen::Vector3d> local = stored;
    for (const GltfLayout::Part& part : file.gltf->parts)
    {
        const Eigen::Matrix3d inverse = part.linear.inverse();
        for (std::size_t i = part.first[list]; i < part.end[list]; ++i)
            if (after[i] != before[i])
                local[i] =
                    part.is_in_place() ? after[i] : to_local(part, inverse, after[i]);
    }
    overwrite_changed(places, numbers_of(stored), numbers_of(local), file.path, body);
}

Eigen::Vector3d with_length_of(const Eigen::Vector3d& vector,
                               const Eigen::Vector3d& other)
{
    const double length = vector.norm();
    return length > 0 ? Eigen::Vector3d(vector * (other.norm() / length)) : vector;
}

void patch_body(const GeometryFile& file, const Patch& patch, std::string& body)
{
    const Geometry& geometry = file.geometry;
    using Part = GltfLayout::Part;
    patch_vectors(
        file, 0, geometry.sample_places, geometry.samples, patch.samples,
        [](const Part& part, const Eigen::Matrix3d& inverse, const Eigen::Vector3d& x)
        { return Eigen::Vector3d(inverse * (x - part.shift)); },
        body);
    patch_vectors(
        file, 1, geometry.direction_places, geometry.directions, patch.directions,
        [](const Part& part, const Eigen::Matrix3d&, const Eigen::Vector3d& n)
        { return with_length_of(part.linear.transpose() * n, n); },
        body);
    patch_vectors(
        file, 2, geometry.tangent_places, geometry.tangents, patch.tangents,
        [](const Part&, const Eigen::Matrix3d& inverse, const Eigen::Vector3d& t)
        { return with_length_of(inverse * t, t); },
        body);
}

/// The smallest (sign 1) or largest (-1) of each number of an accessor's elements.
std::vector<double> bounds_of(const GltfLayout::Data& data, const std::string& body,
                              double sign)
{
    std::vector<double> bounds(data.length, std::numeric_limits<double>::infinity());
    for (std::uint64_t i = 0; i < data.count; ++i)
        for (std::size_t k = 0; k < data.length; ++k)
            bounds[k] = std::min(bounds[k], sign * load_stored(body.data() + data.start +
                                                                   i * data.stride +
                                                                   k * sizeof(float),
                                                               Scalar::Float32, false));
    for (double& bound : bounds)
        bound *= sign;
    return bounds;
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

void replace_bounds(std::string_view json, TextRange accessor,
                    const GltfLayout::Data& data, const std::string& body,
                    std::vector<Replacement>& out)
{
    for (const auto& [key, sign] : {std::pair("min", 1.0), std::pair("max", -1.0)})
    {
        const std::optional<TextRange> array = json_member(json, accessor, key);
        if (!array)
            continue;
        const std::vector<TextRange> items = json_items(json, *array);
        const std::vector<double> bounds = bounds_of(data, body, sign);
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

/// The file with replacements in its JSON and \p body in its binary chunk.
std::string assembled(const GeometryFile& file, std::vector<Replacement> replacements,
                      const std::string& body)
{
    const GltfLayout& layout = *file.gltf;
    const std::string_view bytes = file.bytes;
    const std::string_view old =
        bytes.substr(layout.json.begin, layout.json.end - layout.json.begin);
    std::sort(replacements.begin(), replacements.end(),
              [](const Replacement& a, const Replacement& b)
              { return a.range.begin < b.range.begin; });
    std::string json;
    std::size_t copied = 0;
    for (const Replacement& replacement : replacements)
    {
        json += old.substr(copied, replacement.range.begin - copied);
        json += replacement.text;
        copied = replacement.range.end;
    }
    json += old.substr(copied);
    if (file.geometry.format != "glb")
        return json;
    // Chunks are padded to whole words; lengths stand before the chunk and the file.
    if (json.size() != old.size())
        json.resize((json.size() + 3) / 4 * 4, ' ');
    const auto word = [](std::size_t value)
    {
        std::string text;
        store(static_cast<double>(value), Scalar::UInt32, false, text);
        return text;
    };
    std::uint32_t length;
    std::memcpy(&length, bytes.data() + 8, sizeof length);
    std::string out(bytes.substr(0, 8));
    out += word(length - old.size() + json.size());
    out += word(json.size());
    out += bytes.substr(16, layout.json.begin - 16);
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

PatchedGltf patched_gltf(const GeometryFile& file, const Patch& patch,
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

    const std::string_view json =
        std::string_view(file.bytes)
            .substr(layout.json.begin, layout.json.end - layout.json.begin);
    const TextRange root = json_root(json);
    std::vector<Replacement> replacements;
    const auto items = [&](const char* key)
    {
        const std::optional<TextRange> array = json_member(json, root, key);
        return array ? json_items(json, *array) : std::vector<TextRange>();
    };
    const std::vector<TextRange> accessors = items("accessors");
    for (const GltfLayout::Data& data : layout.data)
        if (has_changed(data, geometry.unpacked, body))
            replace_bounds(json, accessors[data.accessor], data, body, replacements);

    PatchedGltf result;
    const std::vector<std::string> paths =
        has_names ? companion_paths(layout, output) : std::vector<std::string>();
    const std::vector<TextRange> buffers = items("buffers");
    for (std::size_t i = 0; i < layout.buffers.size(); ++i)
    {
        const GltfLayout::Buffer& buffer = layout.buffers[i];
        const std::string_view before =
            std::string_view(geometry.unpacked).substr(buffer.start, buffer.size);
        const std::string_view after =
            std::string_view(body).substr(buffer.start, buffer.size);
        std::string uri = buffer.uri;
        if (buffer.kind == Kind::Inside && before != after)
        {
            const std::size_t data = uri.find(',') + 1;
            uri.replace(data, std::string::npos,
                        base64_patched(uri.substr(data), before, after));
        }
        if (buffer.kind == Kind::Beside && has_names)
        {
            const std::string& path = paths[result.companions.size()];
            uri = percent_encoded(fs::path(path).filename().string());
            result.companions.push_back({path, std::string(after)});
        }
        if (uri != buffer.uri)
            replacements.push_back(
                {*json_member(json, buffers[i], "uri"), "\"" + uri + "\""});
    }
    result.bytes = assembled(file, std::move(replacements), body);
    return result;
}

} // namespace cellwarp
