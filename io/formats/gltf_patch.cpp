// SPDX-License-Identifier: GPL-3.0-or-later
// Writing: numbers go back from the world to the space of their node and into the
// buffers, then the buffers into what packs them. Of the JSON only bounds, data URIs and
// names of buffers change.
#include "io/formats/gltf.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <utility>

#include <Eigen/LU>

#include "io/base/base64.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/formats/gltf_json.h"
#include "io/formats/gltf_rebuild.h"
#include "io/formats/packed.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
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

Eigen::Vector3d with_length_of(const Eigen::Vector3d& vector,
                               const Eigen::Vector3d& other)
{
    const double length = vector.norm();
    return length > 0 ? Eigen::Vector3d(vector * (other.norm() / length)) : vector;
}

/// One list of samples, directions or tangents before and after the move.
struct Motion
{
    const std::vector<Eigen::Vector3d>&before, &after;
    const std::vector<std::uint32_t>* samples; ///< of each; null: they are the samples
};

/// A vector of the world as the node has it.
Eigen::Vector3d to_node(const GltfToNode& map, std::size_t list, const Eigen::Vector3d& x)
{
    return list == 0 ? map.sample(x) : list == 1 ? map.direction(x) : map.tangent(x);
}

/// Calls put(element, vector) for each element of a run that changes.
template <class Put>
void for_each_moved(const GltfLayout::Run& run, const Motion& motion,
                    const GltfToNode& map, Put&& put)
{
    if (motion.after.empty())
        return;
    for (std::size_t i = run.first; i < run.end; ++i)
        if (motion.after[i] != motion.before[i])
            put((motion.samples ? (*motion.samples)[i] : i) - run.samples,
                to_node(map, run.list, motion.after[i]));
}

/// Puts what changes into \p body where it has a place of its own. What has none is given
/// back.
std::vector<MovedRun> patch_body(const GeometryFile& file, const DeformedSamples& patch,
                                 std::string& body)
{
    const Geometry& geometry = file.geometry;
    const GltfLayout& layout = *file.gltf;
    const Motion motions[] = {
        {geometry.samples, patch.samples, nullptr},
        {geometry.directions, patch.directions, &geometry.direction_samples},
        {geometry.tangents, patch.tangents, &geometry.tangent_samples}};
    std::vector<MovedRun> moved;
    for (std::size_t p = 0; p < layout.parts.size(); ++p)
    {
        const GltfLayout::Part& part = layout.parts[p];
        const GltfToNode map(part);
        for (const GltfLayout::Run& run : part.runs)
        {
            const GltfAccessor& accessor = layout.accessors[run.accessor];
            const auto write = [&](double value, std::uint64_t place, char* bytes)
            {
                if (!overwrite_stored(value, Scalar::Float32, false, bytes))
                    throw does_not_fit(file.path, place, value);
            };
            if (layout.is_own(run.accessor))
            {
                for_each_moved(run, motions[run.list], map,
                               [&](std::size_t element, const Eigen::Vector3d& x)
                               {
                                   for (std::size_t k = 0; k < 3; ++k)
                                   {
                                       const std::uint64_t place =
                                           accessor.start + element * accessor.stride +
                                           k * sizeof(float);
                                       write(x[static_cast<Eigen::Index>(k)], place,
                                             body.data() + place);
                                   }
                               });
                continue;
            }
            std::string before, after;
            for_each_moved(run, motions[run.list], map,
                           [&](std::size_t element, const Eigen::Vector3d& x)
                           {
                               if (after.empty())
                               {
                                   for (const double value :
                                        accessor_numbers(accessor, geometry.unpacked))
                                       store(value, Scalar::Float32, false, before);
                                   after = before;
                               }
                               for (std::size_t k = 0; k < 3; ++k)
                                   write(x[static_cast<Eigen::Index>(k)], accessor.start,
                                         after.data() + (element * accessor.length + k) *
                                                            sizeof(float));
                           });
            if (after != before)
                moved.push_back({p, run, std::move(after)});
        }
    }
    return moved;
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

std::vector<GltfBounds> changed_bounds(const GltfLayout& layout, std::string_view before,
                                       std::string_view after)
{
    std::vector<GltfBounds> bounds;
    for (const GltfLayout::Data& data : layout.data)
        if (has_changed(data, before, after))
        {
            GltfBounds& found = bounds.emplace_back(data);
            for (std::uint64_t i = 0; i < data.count; ++i)
                found.add(after.data() + data.start + i * data.stride);
        }
    return bounds;
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
                {*json_member(json, buffers[i], "uri"), GltfJson::Json(uris[i]).dump()});
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
    std::vector<MovedRun> moved;
    if (geometry.not_writable.empty())
        moved = patch_body(file, patch, body);
    else if (patch.samples != geometry.samples)
        throw malformed({file.path, 0, ""},
                        "cannot be written: " + geometry.not_writable);
    const bool has_names = !output.empty() && num_beside(layout) > 0;
    if (moved.empty() && body == geometry.unpacked && !has_names)
        return {file.bytes, {}};

    const std::vector<GltfBounds> bounds =
        changed_bounds(layout, geometry.unpacked, body);
    if (!moved.empty())
        return rebuilt_gltf(file, std::move(body), bounds, moved, output);
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

} // namespace cellwarp::core
