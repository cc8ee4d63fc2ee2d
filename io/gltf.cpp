// SPDX-License-Identifier: GPL-3.0-or-later
// Reading. Whatever the JSON claims is checked against bytes that are there before
// anything is taken from them or made for them.
#include "io/gltf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "io/base64.h"
#include "io/bytes.h"
#include "io/error.h"
#include "io/number.h"
#include "io/stored_number.h"
#include "io/text.h"

namespace cellwarp
{

namespace
{

using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr std::size_t kMaxNesting = 128;
constexpr std::size_t kMaxInstances = 100000;
/// Samples, corners and uses of primitives that there may be beyond what the buffers
/// hold: instances of meshes, and primitives that share their bytes, could ask for far
/// more than the file is long.
constexpr std::uint64_t kMaxShared = 10000000;
/// What one byte of the buffers can hold: a strip of bytes has three corners for each.
constexpr std::uint64_t kMaxPerByte = 4;
constexpr double kSingular = 1e-12;

/// Extensions that a file may require: they change no position and nothing that turns,
/// or what they change is understood.
bool is_known_extension(const std::string& name)
{
    static constexpr std::string_view prefixes[] = {
        "KHR_materials_", "KHR_texture_", "EXT_texture_",  "KHR_lights_",
        "EXT_lights_",    "KHR_xmp",      "KHR_animation_"};
    static constexpr std::string_view names[] = {
        "KHR_mesh_quantization", "KHR_node_visibility", "MSFT_texture_dds",
        "EXT_mesh_gpu_instancing"};
    return std::find(std::begin(names), std::end(names), name) != std::end(names) ||
           std::any_of(std::begin(prefixes), std::end(prefixes),
                       [&](std::string_view prefix) { return name.starts_with(prefix); });
}

struct View
{
    std::uint64_t start = 0, length = 0; ///< in the unpacked buffers [byte]
    std::uint64_t stride = 0;            ///< 0: elements stand one after the other
    bool is_compressed = false;          ///< what stands there is only a fallback
};

struct Sparse
{
    std::uint64_t count = 0, indices = 0, values = 0; ///< starts [byte]
    Scalar index_type = Scalar::UInt8;
};

struct Accessor
{
    Scalar type = Scalar::Float32;
    std::size_t length = 1; ///< numbers of an element
    std::uint64_t count = 0, start = 0, stride = 0;
    bool is_normalised = false, is_compressed = false;
    bool has_data = false; ///< else it is all zeros
    std::optional<Sparse> sparse;

    std::size_t element_bytes() const { return length * stored_size(type); }
    bool is_plain() const
    {
        return has_data && !sparse && !is_compressed && type == Scalar::Float32;
    }
};

std::string element(const char* list, std::size_t i)
{
    return std::string(list) + "[" + std::to_string(i) + "]";
}

/// The numbers of an integer type as the fractions that they stand for.
double fraction(double value, Scalar type)
{
    switch (type)
    {
    case Scalar::Int8:
        return std::max(value / 127.0, -1.0);
    case Scalar::UInt8:
        return value / 255.0;
    case Scalar::Int16:
        return std::max(value / 32767.0, -1.0);
    case Scalar::UInt16:
        return value / 65535.0;
    default:
        return value;
    }
}

std::string decoded_percents(const std::string& uri)
{
    const auto digit = [](char c)
    {
        return c >= '0' && c <= '9'   ? c - '0'
               : c >= 'A' && c <= 'F' ? c - 'A' + 10
               : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                      : -1;
    };
    std::string path;
    for (std::size_t i = 0; i < uri.size(); ++i)
        if (uri[i] == '%' && i + 2 < uri.size() && digit(uri[i + 1]) >= 0 &&
            digit(uri[i + 2]) >= 0)
        {
            path += static_cast<char>(16 * digit(uri[i + 1]) + digit(uri[i + 2]));
            i += 2;
        }
        else
            path += uri[i];
    return path;
}

class GltfReader
{
public:
    /// With a plan it takes no numbers, and \p input gives what the file's bytes lack.
    explicit GltfReader(GeometryFile& file, GltfPlan* plan = nullptr,
                        const InputFile* input = nullptr)
        : file_(file), out_(file.geometry), plan_(plan), input_(input),
          file_bytes_(input ? input->size() : file.bytes.size())
    {
    }

    void read()
    {
        find_container();
        parse();
        check_asset();
        check_lists();
        read_buffers();
        read_views();
        read_accessors();
        walk_nodes();
        finish();
        file_.gltf = std::make_shared<const GltfLayout>(std::move(layout_));
    }

private:
    [[noreturn]] void fail(const std::string& field, const std::string& what) const
    {
        throw malformed({file_.path, 0, field}, what);
    }

    // --- JSON ------------------------------------------------------------------------
    static const Json* find(const Json& object, const char* key)
    {
        const auto found = object.find(key);
        return found == object.end() ? nullptr : &*found;
    }
    /// A list of objects of the root, as checked by check_lists(); empty if it is not
    /// there.
    const Json& list(const char* key) const
    {
        static const Json none = Json::array();
        const Json* found = find(json_, key);
        return found ? *found : none;
    }
    void check_lists() const
    {
        for (const char* key :
             {"scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers"})
            if (const Json& found = list(key);
                !found.is_array() ||
                std::any_of(found.begin(), found.end(),
                            [](const Json& e) { return !e.is_object(); }))
                fail(key, "need a list of objects");
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
            if (const Json* names = find(json_, key); names && names->is_array())
                if (std::find(names->begin(), names->end(), extension_name) !=
                    names->end())
                    return true;
        return false;
    }

    // --- the container ---------------------------------------------------------------
    std::uint32_t word(std::size_t at) const
    {
        std::uint32_t value;
        if (at + sizeof value <= file_.bytes.size())
            std::memcpy(&value, file_.bytes.data() + at, sizeof value);
        else
            input_->read_at(at, reinterpret_cast<char*>(&value), sizeof value);
        return value;
    }
    void find_container()
    {
        const std::string& bytes = file_.bytes;
        layout_.json = {0, bytes.size()};
        if (out_.format != "glb")
            return;
        constexpr std::uint32_t kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
        constexpr std::size_t kHeaderBytes = 12, kChunkHeaderBytes = 8;
        if (file_bytes_ < kHeaderBytes + kChunkHeaderBytes || !bytes.starts_with("glTF"))
            fail("header", "is no binary glTF (need its magic word)");
        if (word(4) != 2)
            fail("header (byte 4)",
                 "version: got " + std::to_string(word(4)) + ", need 2");
        const std::size_t length = word(8);
        if (length > file_bytes_ || length < kHeaderBytes + kChunkHeaderBytes)
            fail("header (byte 8)", "length: got " + std::to_string(length) +
                                        ", the file has " + std::to_string(file_bytes_));
        if (length < file_bytes_)
            out_.warnings.push_back(
                at({file_.path, 0, ""}, std::to_string(file_bytes_ - length) +
                                            " bytes after the end pass through"));
        for (std::size_t at = kHeaderBytes, chunk = 0; at < length; ++chunk)
        {
            const std::string where =
                "chunk " + std::to_string(chunk) + " (byte " + std::to_string(at) + ")";
            if (length - at < kChunkHeaderBytes)
                fail(where, "the file ends in its header");
            const std::size_t size = word(at);
            if (size > length - at - kChunkHeaderBytes)
                fail(where, "length: got " + std::to_string(size) + ", the file has " +
                                std::to_string(length - at - kChunkHeaderBytes));
            const std::uint32_t type = word(at + 4);
            at += kChunkHeaderBytes;
            if (chunk == 0 && (type != kJsonChunk || size == 0))
                fail(where, "need a JSON chunk that is not empty");
            if (chunk == 0)
                layout_.json = {at, at + size};
            if (chunk == 1 && type == kBinaryChunk)
            {
                layout_.chunk_start = at;
                chunk_size_ = size;
            }
            at += size;
        }
    }
    void parse()
    {
        const std::string_view text =
            std::string_view(file_.bytes)
                .substr(layout_.json.begin, layout_.json.end - layout_.json.begin);
        if (const std::size_t depth = json_depth(text); depth > kMaxNesting)
            fail("JSON", "depth: got " + std::to_string(depth) +
                             " levels of nesting, need at most 128");
        try
        {
            json_ = Json::parse(text);
        }
        catch (const Json::parse_error& error)
        {
            const std::string_view before = text.substr(0, error.byte);
            const std::int64_t line =
                out_.format == "glb" ? 0
                                     : 1 + std::count(before.begin(), before.end(), '\n');
            throw malformed({file_.path, line, ""},
                            "is no JSON (at byte " +
                                std::to_string(layout_.json.begin + error.byte) + ")");
        }
        if (!json_.is_object())
            fail("", "is no glTF: need an object");
    }
    void check_asset()
    {
        const Json* asset = find(json_, "asset");
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
        const Json* required = find(json_, "extensionsRequired");
        if (!required)
            return;
        if (!required->is_array())
            fail("extensionsRequired", "need a list of names");
        for (const Json& name : *required)
            if (!name.is_string() || !is_known_extension(name.get<std::string>()))
                fail("extensionsRequired", name.dump().substr(0, 80) + " cannot be read");
    }

    // --- buffers, views, accessors -----------------------------------------------------
    /// The bytes of a file beside; with a plan none, but the file.
    std::string read_beside(const std::string& uri, const std::string& where,
                            GltfLayout::Buffer& buffer)
    {
        const std::string name = decoded_percents(uri);
        if (name.empty() || name.front() == '/' || name.find(':') != std::string::npos ||
            name.find('\\') != std::string::npos || name.find('\0') != std::string::npos)
            fail(where + ".uri",
                 "got " + in_quotes(uri) + ", need a file in the same folder or below");
        const fs::path folder = fs::path(file_.path).parent_path();
        buffer.path = (folder / name).string();
        // Also through symbolic links it must not lead out of the folder.
        std::error_code error;
        const fs::path home = fs::weakly_canonical(folder.empty() ? "." : folder, error);
        const fs::path target =
            error ? fs::path() : fs::weakly_canonical(buffer.path, error);
        if (error)
            throw Error(Fault::File,
                        at({file_.path, 0, where + ".uri"},
                           "cannot open " + in_quotes(uri) + ": " + error.message()));
        const auto [end_of_home, unused] =
            std::mismatch(home.begin(), home.end(), target.begin(), target.end());
        if (end_of_home != home.end())
            fail(where + ".uri",
                 "got " + in_quotes(uri) + ", which leads out of the file's folder");
        // Many buffers may name one file: it is read once.
        const auto [known, is_new] =
            buffer_of_file_.try_emplace(target.string(), layout_.buffers.size());
        if (!is_new)
        {
            const GltfLayout::Buffer& twin = layout_.buffers[known->second];
            buffer.kind = GltfLayout::Buffer::Kind::Again;
            buffer.twin = known->second;
            buffer.start = twin.start;
            buffer.size = twin.size;
            return {};
        }
        buffer.kind = GltfLayout::Buffer::Kind::Beside;
        if (!plan_)
            return read_file(buffer.path);
        plan_->sources.back().file = std::make_unique<InputFile>(buffer.path);
        buffer.size = plan_->sources.back().file->size();
        return {};
    }
    void read_buffers()
    {
        const Json& buffers = list("buffers");
        for (std::size_t i = 0; i < buffers.size(); ++i)
        {
            const std::string where = element("buffers", i);
            const std::uint64_t size = count_of(buffers[i], "byteLength", where);
            GltfLayout::Buffer buffer;
            buffer.start = body_bytes_;
            std::string data;
            if (plan_)
                plan_->sources.emplace_back();
            if (buffers[i].contains("uri"))
            {
                buffer.uri = text_of(buffers[i], "uri", where);
                if (buffer.uri.starts_with("data:"))
                {
                    buffer.kind = GltfLayout::Buffer::Kind::Inside;
                    const std::size_t comma = buffer.uri.find(',');
                    const std::string head = buffer.uri.substr(0, comma);
                    std::optional<std::string> bytes;
                    if (comma != std::string::npos && head.ends_with(";base64"))
                        bytes = base64_decoded(
                            std::string_view(buffer.uri).substr(comma + 1));
                    if (!bytes)
                        fail(where, "its data URI is no base64");
                    data = std::move(*bytes);
                }
                else
                    data = read_beside(buffer.uri, where, buffer);
            }
            else if (i == 0 && layout_.chunk_start > 0)
            {
                buffer.kind = GltfLayout::Buffer::Kind::Chunk;
                buffer.size = chunk_size_;
                if (!plan_)
                    data = file_.bytes.substr(layout_.chunk_start, chunk_size_);
            }
            buffer.size = std::max<std::uint64_t>(buffer.size, data.size());
            if (buffer.kind != GltfLayout::Buffer::Kind::Absent && size > buffer.size)
                fail(where, "byteLength: got " + std::to_string(size) +
                                ", its data has " + std::to_string(buffer.size));
            if (buffer.kind != GltfLayout::Buffer::Kind::Again)
                body_bytes_ += buffer.size;
            if (plan_)
                plan_->sources.back().inside = std::move(data);
            else
                out_.unpacked += data;
            declared_.push_back(size);
            layout_.buffers.push_back(std::move(buffer));
        }
    }
    void read_views()
    {
        const Json& views = list("bufferViews");
        for (std::size_t i = 0; i < views.size(); ++i)
        {
            const std::string where = element("bufferViews", i);
            const Json* number = find(views[i], "buffer");
            if (!number)
                fail(where + ".buffer", "is missing");
            const std::size_t b =
                index_of(*number, where + ".buffer", "buffers", layout_.buffers.size());
            const std::uint64_t offset = count_of(views[i], "byteOffset", where, 0);
            View view;
            view.length = count_of(views[i], "byteLength", where);
            if (offset > declared_[b] || view.length > declared_[b] - offset)
                fail(where, "lies outside of its buffer (bytes " +
                                std::to_string(offset) + " and " +
                                std::to_string(view.length) + " more of " +
                                std::to_string(declared_[b]) + ")");
            view.stride = count_of(views[i], "byteStride", where, 0);
            if (views[i].contains("byteStride") && (view.stride < 4 || view.stride > 252))
                fail(where, "byteStride: got " + std::to_string(view.stride) +
                                ", need 4 to 252");
            view.is_compressed = extension(views[i], "EXT_meshopt_compression");
            const bool is_absent =
                layout_.buffers[b].kind == GltfLayout::Buffer::Kind::Absent;
            if (is_absent && view.is_compressed)
                fail(where, "EXT_meshopt_compression cannot be read");
            if (is_absent)
                fail(element("buffers", b), "has no data");
            view.start = layout_.buffers[b].start + offset;
            views_.push_back(view);
        }
    }
    /// Where \p count elements of \p bytes start in a view, checked against its end.
    std::uint64_t start_in(const View& view, std::uint64_t offset, std::uint64_t stride,
                           std::uint64_t count, std::uint64_t bytes,
                           const std::string& where) const
    {
        if (offset > view.length || bytes > view.length - offset ||
            (count - 1) > (view.length - offset - bytes) / stride)
            fail(where, "lies outside of its bufferView (" + std::to_string(count) +
                            " elements from byte " + std::to_string(offset) + " of " +
                            std::to_string(view.length) + ")");
        return view.start + offset;
    }
    Scalar component_type(const Json& object, const std::string& where) const
    {
        switch (count_of(object, "componentType", where))
        {
        case 5120:
            return Scalar::Int8;
        case 5121:
            return Scalar::UInt8;
        case 5122:
            return Scalar::Int16;
        case 5123:
            return Scalar::UInt16;
        case 5125:
            return Scalar::UInt32;
        case 5126:
            return Scalar::Float32;
        default:
            fail(where + ".componentType", "is unknown");
        }
    }
    const View& view_of(const Json& object, const std::string& where) const
    {
        const Json* number = find(object, "bufferView");
        if (!number)
            fail(where + ".bufferView", "is missing");
        return views_[index_of(*number, where + ".bufferView", "bufferViews",
                               views_.size())];
    }
    void read_accessors()
    {
        static const std::map<std::string, std::size_t> lengths = {
            {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
            {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
        const Json& accessors = list("accessors");
        for (std::size_t i = 0; i < accessors.size(); ++i)
        {
            const Json& object = accessors[i];
            const std::string where = element("accessors", i);
            Accessor accessor;
            accessor.type = component_type(object, where);
            const auto length = lengths.find(text_of(object, "type", where));
            if (length == lengths.end())
                fail(where + ".type", "is unknown");
            accessor.length = length->second;
            accessor.count = count_of(object, "count", where);
            if (accessor.count == 0)
                fail(where + ".count", "got 0, need at least 1");
            if (const Json* normalised = find(object, "normalized"))
                accessor.is_normalised =
                    normalised->is_boolean() && normalised->get<bool>();
            if (object.contains("bufferView"))
            {
                const View& view = view_of(object, where);
                accessor.has_data = true;
                accessor.is_compressed = view.is_compressed;
                accessor.stride = view.stride ? view.stride : accessor.element_bytes();
                if (accessor.stride < accessor.element_bytes())
                    fail(where, "byteStride: got " + std::to_string(accessor.stride) +
                                    ", its elements have " +
                                    std::to_string(accessor.element_bytes()) + " bytes");
                accessor.start = start_in(view, count_of(object, "byteOffset", where, 0),
                                          accessor.stride, accessor.count,
                                          accessor.element_bytes(), where);
            }
            if (const Json* sparse = find(object, "sparse"))
                accessor.sparse = read_sparse(*sparse, accessor, where + ".sparse");
            accessors_.push_back(accessor);
        }
    }
    Sparse read_sparse(const Json& object, const Accessor& accessor,
                       const std::string& where) const
    {
        Sparse sparse;
        const Json* indices = object.is_object() ? find(object, "indices") : nullptr;
        const Json* values = object.is_object() ? find(object, "values") : nullptr;
        if (!indices || !indices->is_object() || !values || !values->is_object())
            fail(where, "need indices and values");
        sparse.count = count_of(object, "count", where);
        if (sparse.count == 0 || sparse.count > accessor.count)
            fail(where + ".count", "got " + std::to_string(sparse.count) +
                                       ", need 1 to " + std::to_string(accessor.count));
        sparse.index_type = component_type(*indices, where + ".indices");
        const std::size_t index_bytes = stored_size(sparse.index_type);
        sparse.indices = start_in(view_of(*indices, where + ".indices"),
                                  count_of(*indices, "byteOffset", where, 0), index_bytes,
                                  sparse.count, index_bytes, where + ".indices");
        sparse.values =
            start_in(view_of(*values, where + ".values"),
                     count_of(*values, "byteOffset", where, 0), accessor.element_bytes(),
                     sparse.count, accessor.element_bytes(), where + ".values");
        return sparse;
    }

    // --- values ------------------------------------------------------------------------
    double stored(std::uint64_t at, const Accessor& accessor) const
    {
        const double value = load_stored(out_.unpacked.data() + at, accessor.type, false);
        return accessor.is_normalised ? fraction(value, accessor.type) : value;
    }
    /// Zeros take no bytes in the file: they must not take many here.
    void check_zeros(std::size_t number) const
    {
        const Accessor& accessor = accessors_[number];
        if (!accessor.has_data && accessor.count > body_bytes_)
            fail(element("accessors", number), "has no bufferView (for " +
                                                   std::to_string(accessor.count) +
                                                   " elements)");
    }
    /// The first three numbers (of a scalar: the one) of each element.
    std::vector<Eigen::Vector3d> values_of(std::size_t number) const
    {
        const Accessor& accessor = accessors_[number];
        const std::string where = element("accessors", number);
        check_zeros(number);
        std::vector<Eigen::Vector3d> values(static_cast<std::size_t>(accessor.count),
                                            Eigen::Vector3d::Zero());
        const auto load = [&](std::uint64_t at, Eigen::Vector3d& value)
        {
            for (std::size_t k = 0; k < std::min<std::size_t>(3, accessor.length); ++k)
                value[static_cast<Eigen::Index>(k)] =
                    stored(at + k * stored_size(accessor.type), accessor);
        };
        for (std::size_t i = 0; accessor.has_data && i < values.size(); ++i)
            load(accessor.start + i * accessor.stride, values[i]);
        if (!accessor.sparse)
            return values;
        const Sparse& sparse = *accessor.sparse;
        for (std::uint64_t i = 0; i < sparse.count; ++i)
        {
            const double index = load_stored(out_.unpacked.data() + sparse.indices +
                                                 i * stored_size(sparse.index_type),
                                             sparse.index_type, false);
            if (!(index >= 0 && index < static_cast<double>(accessor.count)))
                fail(where + ".sparse.indices", "is out of range (got " +
                                                    shortest(index) + " of " +
                                                    std::to_string(accessor.count) + ")");
            load(sparse.values + i * accessor.element_bytes(),
                 values[static_cast<std::size_t>(index)]);
        }
        return values;
    }

    // --- nodes -------------------------------------------------------------------------
    struct Visit
    {
        std::size_t node;
        std::size_t depth;
        Eigen::Affine3d to_world;
    };
    Eigen::Affine3d matrix_of(const Json& node, const std::string& where) const
    {
        Eigen::Affine3d map = Eigen::Affine3d::Identity();
        if (const auto matrix = numbers<16>(node, "matrix", where))
        {
            const auto& m = *matrix;
            if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
                fail(where + ".matrix", "its last row is not 0 0 0 1");
            for (int column = 0; column < 4; ++column)
                for (int row = 0; row < 3; ++row)
                    map(row, column) = m[static_cast<std::size_t>(4 * column + row)];
            return map;
        }
        if (const auto shift = numbers<3>(node, "translation", where))
            map.translate(Eigen::Vector3d((*shift)[0], (*shift)[1], (*shift)[2]));
        if (const auto turn = numbers<4>(node, "rotation", where))
        {
            const Eigen::Quaterniond q((*turn)[3], (*turn)[0], (*turn)[1], (*turn)[2]);
            if (!(q.norm() > 0) || !std::isfinite(q.norm()))
                fail(where + ".rotation", "is no rotation");
            if (q.vec() != Eigen::Vector3d::Zero())
                map.rotate(q.normalized());
        }
        if (const auto scale = numbers<3>(node, "scale", where))
            map.scale(Eigen::Vector3d((*scale)[0], (*scale)[1], (*scale)[2]));
        return map;
    }
    /// Children of all nodes; each has at most one parent, and there is no ring.
    void read_tree()
    {
        const Json& nodes = list("nodes");
        children_.resize(nodes.size());
        std::vector<std::size_t> parent(nodes.size(), nodes.size());
        for (std::size_t i = 0; i < nodes.size(); ++i)
        {
            const std::string where = element("nodes", i);
            if (const Json* mesh = find(nodes[i], "mesh"))
                nodes_of_mesh_[index_of(*mesh, where + ".mesh", "meshes",
                                        list("meshes").size())]
                    .push_back(i);
            const Json* children = find(nodes[i], "children");
            if (!children)
                continue;
            if (!children->is_array())
                fail(where + ".children", "need a list of nodes");
            for (const Json& child : *children)
            {
                const std::size_t c =
                    index_of(child, where + ".children", "nodes", nodes.size());
                if (parent[c] != nodes.size())
                    fail(element("nodes", c), "has two parents, nodes[" +
                                                  std::to_string(parent[c]) + "] and " +
                                                  where);
                parent[c] = i;
                children_[i].push_back(c);
            }
        }
        std::size_t reached = 0;
        for (std::size_t i = 0; i < nodes.size(); ++i)
            if (parent[i] == nodes.size())
            {
                roots_.push_back(i);
                std::vector<std::size_t> rest = {i};
                while (!rest.empty())
                {
                    const std::size_t node = rest.back();
                    rest.pop_back();
                    ++reached;
                    rest.insert(rest.end(), children_[node].begin(),
                                children_[node].end());
                }
            }
        if (reached < nodes.size())
            fail("nodes", "some are their own ancestors");
        const Json* scene = find(json_, "scene");
        if (!scene)
            return;
        const Json& scenes = list("scenes");
        const std::size_t s = index_of(*scene, "scene", "scenes", scenes.size());
        roots_.clear();
        const std::string where = element("scenes", s) + ".nodes";
        const Json* listed = find(scenes[s], "nodes");
        if (listed && !listed->is_array())
            fail(where, "need a list of nodes");
        std::set<std::size_t> known;
        for (const Json& node : listed ? *listed : Json::array())
        {
            const std::size_t n = index_of(node, where, "nodes", nodes.size());
            if (parent[n] != nodes.size() || !known.insert(n).second)
                fail(where,
                     "nodes[" + std::to_string(n) + "] is no root, or listed twice");
            roots_.push_back(n);
        }
    }
    void walk_nodes()
    {
        read_tree();
        read_meshes();
        const Json& nodes = list("nodes");
        std::vector<Visit> rest;
        for (auto root = roots_.rbegin(); root != roots_.rend(); ++root)
            rest.push_back({*root, 1, Eigen::Affine3d::Identity()});
        std::size_t instances = 0;
        while (!rest.empty())
        {
            const Visit visit = rest.back();
            rest.pop_back();
            const std::string where = element("nodes", visit.node);
            if (visit.depth > kMaxNesting)
                fail(where, "is nested deeper than 128 nodes");
            const Eigen::Affine3d to_world =
                visit.to_world * matrix_of(nodes[visit.node], where);
            const std::vector<std::size_t>& children = children_[visit.node];
            for (auto child = children.rbegin(); child != children.rend(); ++child)
                rest.push_back({*child, visit.depth + 1, to_world});
            if (!nodes[visit.node].contains("mesh"))
                continue;
            if (++instances > kMaxInstances)
                fail(where, "more than 100000 nodes with meshes");
            instance(visit.node, to_world);
        }
    }

    // --- meshes ------------------------------------------------------------------------
    struct Primitive
    {
        std::size_t position = 0;
        std::optional<std::size_t> normal, tangent, indices;
        std::uint64_t mode = 4;
        std::string where;
    };
    std::optional<std::size_t> attribute(const Json& attributes, const char* name,
                                         std::size_t length,
                                         const std::string& where) const
    {
        const Json* found = find(attributes, name);
        if (!found)
            return std::nullopt;
        const std::string field = where + ": " + name;
        const std::size_t number =
            index_of(*found, field, "accessors", accessors_.size());
        const Accessor& accessor = accessors_[number];
        const bool may_be_whole = is_quantised_ && accessor.type != Scalar::UInt32;
        if (accessor.length != length ||
            (accessor.type != Scalar::Float32 && !may_be_whole))
            fail(field, "accessors[" + std::to_string(number) + "] is no VEC" +
                            std::to_string(length) + " of floats");
        return number;
    }
    void read_meshes()
    {
        const Json& meshes = list("meshes");
        is_quantised_ = uses("KHR_mesh_quantization");
        for (std::size_t m = 0; m < meshes.size(); ++m)
        {
            std::vector<Primitive>& primitives = meshes_.emplace_back();
            const Json* listed = find(meshes[m], "primitives");
            if (!listed || !listed->is_array())
                fail(element("meshes", m) + ".primitives", "need a list");
            for (std::size_t p = 0; p < listed->size(); ++p)
                primitives.push_back(read_primitive((*listed)[p], m,
                                                    element("meshes", m) + "." +
                                                        element("primitives", p)));
        }
    }
    Primitive read_primitive(const Json& object, std::size_t mesh,
                             const std::string& where)
    {
        Primitive primitive;
        primitive.where = where;
        const Json* attributes =
            object.is_object() ? find(object, "attributes") : nullptr;
        if (!attributes || !attributes->is_object())
            fail(where + ".attributes", "need an object");
        const auto position = attribute(*attributes, "POSITION", 3, where);
        if (!position)
            fail(where, "has no POSITION");
        primitive.position = *position;
        primitive.normal = attribute(*attributes, "NORMAL", 3, where);
        primitive.tangent = attribute(*attributes, "TANGENT", 4, where);
        for (const auto& other : {primitive.normal, primitive.tangent})
            if (other && accessors_[*other].count != accessors_[primitive.position].count)
                fail(where, "its attributes differ in count (accessors[" +
                                std::to_string(*other) + "] and accessors[" +
                                std::to_string(primitive.position) + "])");
        if (const Json* indices = find(object, "indices"))
        {
            primitive.indices =
                index_of(*indices, where + ".indices", "accessors", accessors_.size());
            const Accessor& accessor = accessors_[*primitive.indices];
            if (accessor.length != 1 ||
                (accessor.type != Scalar::UInt8 && accessor.type != Scalar::UInt16 &&
                 accessor.type != Scalar::UInt32))
                fail(where + ".indices", "accessors[" +
                                             std::to_string(*primitive.indices) +
                                             "] is no SCALAR of unsigned integers");
        }
        primitive.mode = count_of(object, "mode", where, 4);
        if (primitive.mode > 6)
            fail(where + ".mode",
                 "got " + std::to_string(primitive.mode) + ", need 0 to 6");
        if (extension(object, "KHR_draco_mesh_compression"))
        {
            if (!accessors_[primitive.position].has_data)
                fail(where, "KHR_draco_mesh_compression cannot be read");
            reason_of_mesh_.try_emplace(mesh, "a primitive is also compressed by Draco");
        }
        if (object.contains("targets"))
            reason_of_mesh_.try_emplace(mesh, "its mesh has morph targets");
        for (const auto& [name, value] : attributes->items())
            if (name != "POSITION")
                attribute_names_.insert(name == "NORMAL"    ? "normals"
                                        : name == "TANGENT" ? "tangents"
                                                            : name);
        for (const auto& used :
             {std::optional(primitive.position), primitive.normal, primitive.tangent})
            if (used)
            {
                users_[*used].insert(mesh);
                if (!accessors_[*used].is_plain())
                    reason_of_mesh_.try_emplace(
                        mesh, "accessors[" + std::to_string(*used) +
                                  "] is sparse, compressed or not stored as floats");
            }
        return primitive;
    }
    void refuse_writing(std::size_t node, const std::string& why)
    {
        if (!out_.not_writable.empty())
            return;
        const Json* name = find(list("nodes")[node], "name");
        out_.not_writable = element("nodes", node);
        if (name && name->is_string())
            out_.not_writable += " " + in_quotes(name->get<std::string>());
        out_.not_writable += ": " + why;
    }
    /// What of this node's mesh is not the node's alone, or not stored as it is.
    void check_writable(std::size_t node, std::size_t mesh, const Eigen::Matrix3d& linear)
    {
        const Json& object = list("nodes")[node];
        const std::vector<std::size_t>& same = nodes_of_mesh_[mesh];
        if (same.size() > 1)
            refuse_writing(node, "its mesh has several instances (also " +
                                     element("nodes", same[same[0] == node]) + ")");
        if (extension(object, "EXT_mesh_gpu_instancing"))
            refuse_writing(node, "its mesh has several instances (on the GPU)");
        if (object.contains("skin"))
            refuse_writing(node, "its mesh has a skin");
        if (const auto reason = reason_of_mesh_.find(mesh);
            reason != reason_of_mesh_.end())
            refuse_writing(node, reason->second);
        for (const Primitive& primitive : meshes_[mesh])
            for (const auto& used :
                 {std::optional(primitive.position), primitive.normal, primitive.tangent})
                if (used && users_[*used].size() > 1)
                    refuse_writing(node, "accessors[" + std::to_string(*used) +
                                             "] is used by several meshes");
        if (!Eigen::FullPivLU<Eigen::Matrix3d>(linear)
                 .setThreshold(kSingular)
                 .isInvertible())
            refuse_writing(node, "its matrix is singular");
    }

    static void add_places(const Accessor& accessor, std::size_t element_number,
                           ByteOffsets& places)
    {
        for (std::size_t k = 0; k < 3; ++k)
            places.starts.push_back(accessor.start + element_number * accessor.stride +
                                    k * sizeof(float));
    }
    /// Directions or tangents of samples from \p first_sample on.
    void add_vectors(std::size_t number, std::size_t first_sample,
                     const Eigen::Matrix3d& map, std::vector<Eigen::Vector3d>& vectors,
                     std::vector<std::uint32_t>& samples, ByteOffsets& places)
    {
        count_up(num_vectors_, accessors_[number].count, "normals and tangents");
        const std::vector<Eigen::Vector3d> values = values_of(number);
        for (std::size_t i = 0; i < values.size(); ++i)
        {
            // One that is none stays as it is: it takes no part.
            const Eigen::Vector3d vector = turned_to_world(map, values[i]);
            if (!vector.allFinite() || vector.isZero(0))
            {
                num_bad_vectors_ += values[i].allFinite() ? 0 : 1;
                continue;
            }
            vectors.push_back(vector);
            samples.push_back(static_cast<std::uint32_t>(first_sample + i));
            if (accessors_[number].is_plain())
                add_places(accessors_[number], i, places);
        }
        note_data(number);
    }
    GltfLayout::Data data_of(std::size_t number) const
    {
        const Accessor& accessor = accessors_[number];
        return {number, accessor.start, accessor.stride, accessor.count, accessor.length};
    }
    void note_data(std::size_t number)
    {
        if (accessors_[number].is_plain())
            layout_.data.push_back(data_of(number));
    }
    /// The first of them; with a plan, the run that they are.
    std::size_t add_samples(std::size_t number, const GltfLayout::Part& part)
    {
        const std::size_t first = static_cast<std::size_t>(num_samples_);
        const Accessor& accessor = accessors_[number];
        check_zeros(number);
        count_up(num_samples_, accessor.count, "samples");
        if (plan_)
        {
            plan_->runs.push_back({data_of(number), {}, {}, layout_.parts.size()});
            note_data(number);
            return plan_->runs.size() - 1;
        }
        const std::vector<Eigen::Vector3d> values = values_of(number);
        for (std::size_t i = 0; i < values.size(); ++i)
        {
            const Eigen::Vector3d world =
                part.is_in_place() ? values[i]
                                   : Eigen::Vector3d(part.to_world * values[i]);
            if (!world.allFinite())
                throw vertex_not_finite(file_.path, data_of(number), i);
            out_.samples.push_back(world);
            if (accessor.is_plain())
                add_places(accessor, i, out_.sample_places);
        }
        note_data(number);
        return first;
    }
    /// Counts what there may not be much more of than the buffers have bytes.
    void count_up(std::uint64_t& total, std::uint64_t more, const char* what) const
    {
        const std::uint64_t most = kMaxPerByte * body_bytes_ + kMaxShared;
        if (more > most || total > most - more)
            fail("nodes", "more " + std::string(what) + " than " + std::to_string(most) +
                              ": meshes, or primitives that share their data, stand "
                              "there too often");
        total += more;
    }
    void add_to_run(std::size_t number, std::vector<GltfLayout::Data>& list)
    {
        count_up(num_vectors_, accessors_[number].count, "normals and tangents");
        list.push_back(data_of(number));
        note_data(number);
    }
    void instance(std::size_t node, const Eigen::Affine3d& node_to_world)
    {
        const Json& object = list("nodes")[node];
        const std::size_t mesh = static_cast<std::size_t>(object["mesh"].get<double>());
        GltfLayout::Part part;
        // A skin places its mesh by its joints alone: what is stored is the bind pose.
        const Eigen::Affine3d to_world =
            object.contains("skin") ? Eigen::Affine3d::Identity() : node_to_world;
        part.to_world = to_world;
        const Eigen::Matrix3d linear = to_world.linear();
        check_writable(node, mesh, linear);
        const Eigen::FullPivLU<Eigen::Matrix3d> inverse(linear);
        if (!linear.isIdentity(0) && inverse.isInvertible())
            part.of_normals = inverse.inverse().transpose();
        part.first[0] = out_.samples.size();
        part.first[1] = out_.directions.size();
        part.first[2] = out_.tangents.size();
        // Primitives of one mesh may share what they are made of.
        std::map<std::size_t, std::size_t> first_samples;
        std::set<std::pair<std::size_t, std::size_t>> known;
        for (const Primitive& primitive : meshes_[mesh])
        {
            const auto [samples, is_new] =
                first_samples.try_emplace(primitive.position, 0);
            if (is_new)
                samples->second = add_samples(primitive.position, part);
            const bool has_normals =
                primitive.normal &&
                known.emplace(primitive.position, *primitive.normal).second;
            const bool has_tangents =
                primitive.tangent &&
                known.emplace(primitive.position, *primitive.tangent).second;
            if (has_normals && plan_)
                add_to_run(*primitive.normal, plan_->runs[samples->second].directions);
            else if (has_normals)
                add_vectors(*primitive.normal, samples->second, part.of_normals,
                            out_.directions, out_.direction_samples,
                            out_.direction_places);
            if (has_tangents && plan_)
                add_to_run(*primitive.tangent, plan_->runs[samples->second].tangents);
            else if (has_tangents)
                add_vectors(*primitive.tangent, samples->second, part.to_world.linear(),
                            out_.tangents, out_.tangent_samples, out_.tangent_places);
            add_faces(primitive, samples->second);
        }
        part.end[0] = out_.samples.size();
        part.end[1] = out_.directions.size();
        part.end[2] = out_.tangents.size();
        layout_.parts.push_back(part);
    }
    void add_faces(const Primitive& primitive, std::size_t first_sample)
    {
        const std::uint64_t samples = accessors_[primitive.position].count;
        const std::uint64_t count =
            primitive.indices ? accessors_[*primitive.indices].count : samples;
        count_up(num_corners_,
                 primitive.mode < 5 || count < 3 ? count + 1 : 3 * (count - 2),
                 "corners of faces");
        std::vector<Eigen::Vector3d> indices;
        if (primitive.indices && !plan_)
        {
            indices = values_of(*primitive.indices);
            for (std::size_t i = 0; i < indices.size(); ++i)
                if (indices[i].x() >= static_cast<double>(samples))
                    throw index_out_of_range(file_.path, primitive.where, i,
                                             indices[i].x(), samples);
        }
        if (primitive.indices && plan_)
            plan_->indices.push_back({data_of(*primitive.indices),
                                      accessors_[*primitive.indices].type, samples,
                                      primitive.where});
        if (primitive.mode < 4)
            return;
        if (primitive.mode == 4 ? count % 3 != 0 : count < 3)
            fail(primitive.where + ".indices",
                 "got " + std::to_string(count) + " corners, need " +
                     (primitive.mode == 4 ? "a multiple of 3" : "at least 3"));
        if (plan_)
            return;
        const auto corner = [&](std::uint64_t i)
        {
            const std::size_t at = static_cast<std::size_t>(i);
            return static_cast<std::uint32_t>(
                first_sample +
                (primitive.indices ? static_cast<std::size_t>(indices[at].x()) : at));
        };
        const std::uint64_t faces = primitive.mode == 4 ? count / 3 : count - 2;
        for (std::uint64_t f = 0; f < faces; ++f)
        {
            // Triangles, a strip (every other one is turned over), or a fan.
            const std::uint64_t odd = f % 2;
            const std::array<std::uint64_t, 3> which =
                primitive.mode == 4   ? std::array{3 * f, 3 * f + 1, 3 * f + 2}
                : primitive.mode == 5 ? std::array{f, f + 1 + odd, f + 2 - odd}
                                      : std::array{f + 1, f + 2, std::uint64_t(0)};
            for (const std::uint64_t i : which)
                out_.corners.push_back(corner(i));
            out_.face_ends.push_back(out_.corners.size());
        }
    }

    // --- the end -----------------------------------------------------------------------
    /// Where an accessor's bytes stand.
    struct Span
    {
        std::uint64_t start, end, stride, bytes;
        std::size_t accessor;
        bool may_change;
    };
    /// Spans with one stride whose elements stand at one place of it: to what comes after
    /// them they are one.
    struct Column
    {
        std::uint64_t stride, offset, bytes;
        auto operator<=>(const Column&) const = default;
        explicit Column(const Span& span)
            : stride(span.stride), offset(span.start % span.stride), bytes(span.bytes)
        {
        }
        /// Whether neither has a byte of the other, wherever they stand.
        bool is_beside(const Column& other) const
        {
            const std::uint64_t apart = (other.offset + stride - offset) % stride;
            return stride == other.stride && apart >= bytes &&
                   apart + other.bytes <= stride;
        }
    };
    /// Columns that have not ended yet, and what ends last of each.
    class Columns
    {
    public:
        /// One that shares bytes with \p span; null if none does. Forgets what has ended.
        const Span* clash(const Span& span)
        {
            const Column column(span);
            for (auto it = last_.begin(); it != last_.end();)
                if (it->second.end <= span.start)
                    it = last_.erase(it);
                else if (!it->first.is_beside(column))
                    return &it->second;
                else
                    ++it;
            return nullptr;
        }
        void add(const Span& span)
        {
            const auto [it, is_new] = last_.try_emplace(Column(span), span);
            if (!is_new && it->second.end < span.end)
                it->second = span;
        }

    private:
        std::map<Column, Span> last_;
    };

    /// Whether numbers that change lie where other accessors read. Spans that clash with
    /// none are columns of one stride, of which there are few: each is compared with few.
    void check_overlaps()
    {
        if (!out_.not_writable.empty())
            return;
        std::vector<Span> spans;
        std::set<std::size_t> changing;
        for (const GltfLayout::Data& data : layout_.data)
            changing.insert(data.accessor);
        for (std::size_t i = 0; i < accessors_.size(); ++i)
            if (const Accessor& a = accessors_[i]; a.has_data)
                spans.push_back({a.start,
                                 a.start + (a.count - 1) * a.stride + a.element_bytes(),
                                 a.stride, a.element_bytes(), i, changing.contains(i)});
        std::sort(
            spans.begin(), spans.end(),
            [](const Span& a, const Span& b)
            { return std::pair(a.start, a.accessor) < std::pair(b.start, b.accessor); });
        Columns fixed, moving;
        for (const Span& span : spans)
        {
            const Span* other = moving.clash(span);
            if (!other && span.may_change)
                other = fixed.clash(span);
            if (other)
            {
                out_.not_writable = "accessors[" + std::to_string(other->accessor) +
                                    "] and accessors[" + std::to_string(span.accessor) +
                                    "] share bytes";
                return;
            }
            (span.may_change ? moving : fixed).add(span);
        }
    }
    void finish()
    {
        if (num_samples_ == 0)
            fail("", "no vertices in its scene");
        out_.sample_places.scalars.fill(Scalar::Float32);
        out_.direction_places.scalars.fill(Scalar::Float32);
        out_.tangent_places.scalars.fill(Scalar::Float32);
        const auto by_accessor = [](const GltfLayout::Data& a, const GltfLayout::Data& b)
        { return a.accessor < b.accessor; };
        std::sort(layout_.data.begin(), layout_.data.end(), by_accessor);
        layout_.data.erase(
            std::unique(layout_.data.begin(), layout_.data.end(),
                        [](const GltfLayout::Data& a, const GltfLayout::Data& b)
                        { return a.accessor == b.accessor; }),
            layout_.data.end());
        check_overlaps();
        if (!out_.not_writable.empty())
            for (ByteOffsets* places :
                 {&out_.sample_places, &out_.direction_places, &out_.tangent_places})
                places->starts.clear();
        out_.attributes.assign(attribute_names_.begin(), attribute_names_.end());
        warn_of_bad_vectors(file_.path, num_bad_vectors_, out_);
    }

    GeometryFile& file_;
    Geometry& out_;
    GltfPlan* plan_;
    const InputFile* input_;
    std::uint64_t file_bytes_;
    GltfLayout layout_;
    std::size_t chunk_size_ = 0;
    Json json_;
    std::vector<std::uint64_t> declared_;               ///< byteLength of the buffers
    std::map<std::string, std::size_t> buffer_of_file_; ///< the first that names it
    std::vector<View> views_;
    std::vector<Accessor> accessors_;
    std::vector<std::vector<std::size_t>> children_; ///< of each node
    std::vector<std::size_t> roots_;                 ///< of the scene
    std::vector<std::vector<Primitive>> meshes_;
    std::map<std::size_t, std::vector<std::size_t>> nodes_of_mesh_;
    std::map<std::size_t, std::set<std::size_t>> users_; ///< meshes of each accessor
    std::map<std::size_t, std::string> reason_of_mesh_;  ///< that it is not writable
    std::set<std::string> attribute_names_;
    bool is_quantised_ = false; ///< positions and the like may be stored as integers
    std::uint64_t num_bad_vectors_ = 0;
    std::uint64_t body_bytes_ = 0; ///< of all buffers up to here
    std::uint64_t num_samples_ = 0, num_vectors_ = 0, num_corners_ = 0;
};

} // namespace

Eigen::Vector3d turned_to_world(const Eigen::Matrix3d& map, const Eigen::Vector3d& vector)
{
    if (map.isIdentity(0))
        return vector;
    const Eigen::Vector3d turned = map * vector;
    const double length = turned.norm();
    return length > 0 ? Eigen::Vector3d(turned * (vector.norm() / length)) : vector;
}

Error vertex_not_finite(const std::string& path, const GltfLayout::Data& data,
                        std::uint64_t i)
{
    return malformed({path, 0,
                      element("accessors", data.accessor) + ": vertex " +
                          std::to_string(i) + " (byte " +
                          std::to_string(data.start + i * data.stride) +
                          " of the buffers)"},
                     "is not finite");
}

Error index_out_of_range(const std::string& path, const std::string& primitive,
                         std::uint64_t i, double index, std::uint64_t samples)
{
    return malformed({path, 0, primitive + ".indices"},
                     "index " + std::to_string(i) + " is out of range (got " +
                         shortest(index) + ", need 0 to " + std::to_string(samples - 1) +
                         ")");
}

void warn_of_bad_vectors(const std::string& path, std::uint64_t count, Geometry& out)
{
    if (count > 0)
        out.warnings.push_back(
            at({path, 0, ""}, std::to_string(count) +
                                  " normals or tangents are not finite and stay as "
                                  "they are"));
}

void scan_gltf(GeometryFile& file)
{
    GltfReader(file).read();
}

GltfPlan plan_gltf(GeometryFile& file, const InputFile& input)
{
    GltfPlan plan;
    GltfReader(file, &plan, &input).read();
    return plan;
}

} // namespace cellwarp
