// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/gltf_data.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string_view>
#include <utility>

#include "io/base/base64.h"
#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/draco_mesh.h"
#include "io/formats/meshopt_view.h"

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

/// The most bytes that one compressed byte of meshopt can stand for.
constexpr std::uint64_t kMostOfPackedByte = 64;

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

/// Where an accessor's bytes stand.
struct Span
{
    std::uint64_t start, end, stride, bytes;
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
        return stride == other.stride && apart >= bytes && apart + other.bytes <= stride;
    }
};
/// Columns that have not ended yet, and what ends last of each.
class Columns
{
public:
    /// Whether one shares bytes with \p span. Forgets what has ended.
    bool clash(const Span& span)
    {
        const Column column(span);
        for (auto it = last_.begin(); it != last_.end();)
            if (it->second.end <= span.start)
                it = last_.erase(it);
            else if (!it->first.is_beside(column))
                return true;
            else
                ++it;
        return false;
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

double sparse_index(const GltfSparse& sparse, std::uint64_t i, std::string_view body)
{
    return load_stored(body.data() + sparse.indices + i * stored_size(sparse.index_type),
                       sparse.index_type, false);
}

double stored(const GltfAccessor& accessor, std::string_view body, std::uint64_t at)
{
    const double value = load_stored(body.data() + at, accessor.type, false);
    return accessor.is_normalised ? fraction(value, accessor.type) : value;
}

/// Calls load(byte, number) for each element, last for those that are told apart.
template <class Load>
void visit_elements(const GltfAccessor& accessor, std::string_view body, Load&& load)
{
    for (std::uint64_t i = 0; accessor.has_data && i < accessor.count; ++i)
        load(accessor.start + i * accessor.stride, static_cast<std::size_t>(i));
    for (std::uint64_t i = 0; accessor.sparse && i < accessor.sparse->count; ++i)
        load(accessor.sparse->values + i * accessor.element_bytes(),
             static_cast<std::size_t>(sparse_index(*accessor.sparse, i, body)));
}

} // namespace

std::size_t GltfAccessor::element_bytes() const
{
    return length * stored_size(type);
}

std::vector<double> accessor_numbers(const GltfAccessor& accessor, std::string_view body)
{
    std::vector<double> numbers(
        static_cast<std::size_t>(accessor.count) * accessor.length, 0.0);
    visit_elements(accessor, body,
                   [&](std::uint64_t at, std::size_t i)
                   {
                       for (std::size_t k = 0; k < accessor.length; ++k)
                           numbers[i * accessor.length + k] = stored(
                               accessor, body, at + k * stored_size(accessor.type));
                   });
    return numbers;
}

GltfData::GltfData(GeometryFile& file, GltfLayout& layout, GltfPlan* plan,
                   const InputFile* input)
    : file_(file), out_(file.geometry), layout_(layout), plan_(plan), input_(input),
      file_bytes_(input ? input->size() : file.bytes.size())
{
    find_container();
    json_.emplace(file_.path,
                  std::string_view(file_.bytes)
                      .substr(layout_.json.begin, layout_.json.end - layout_.json.begin),
                  layout_.json.begin, out_.format != "glb");
    read_buffers();
    read_views();
    read_accessors();
    unpack_primitives();
}

void GltfData::fail(const std::string& field, const std::string& what) const
{
    throw malformed({file_.path, 0, field}, what);
}

std::uint32_t GltfData::word(std::size_t at) const
{
    std::uint32_t value;
    if (at + sizeof value <= file_.bytes.size())
        std::memcpy(&value, file_.bytes.data() + at, sizeof value);
    else
        input_->read_at(at, reinterpret_cast<char*>(&value), sizeof value);
    return value;
}

void GltfData::find_container()
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
        fail("header (byte 4)", "version: got " + std::to_string(word(4)) + ", need 2");
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

std::string GltfData::read_beside(const std::string& uri, const std::string& where,
                                  GltfLayout::Buffer& buffer)
{
    const std::string name = decoded_percents(uri);
    if (name.empty() || name.front() == '/' || name.find(':') != std::string::npos ||
        name.find('\\') != std::string::npos || name.find('\0') != std::string::npos)
        fail(where + ".uri",
             "got " + in_quotes(uri) + ", need a file in the same folder or below");
    const fs::path folder = fs::path(json_->path()).parent_path();
    buffer.path = (folder / name).string();
    // Also through symbolic links it must not lead out of the folder.
    std::error_code error;
    const fs::path home = fs::weakly_canonical(folder.empty() ? "." : folder, error);
    const fs::path target = error ? fs::path() : fs::weakly_canonical(buffer.path, error);
    if (error)
        throw Error(Fault::File,
                    at({json_->path(), 0, where + ".uri"},
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

void GltfData::read_buffers()
{
    const GltfJson::Json& buffers = json_->list("buffers");
    for (std::size_t i = 0; i < buffers.size(); ++i)
    {
        const std::string where = element("buffers", i);
        const std::uint64_t size = json_->count_of(buffers[i], "byteLength", where);
        GltfLayout::Buffer buffer;
        buffer.start = body_bytes_;
        std::string data;
        if (plan_)
            plan_->sources.emplace_back();
        if (buffers[i].contains("uri"))
        {
            buffer.uri = json_->text_of(buffers[i], "uri", where);
            if (buffer.uri.starts_with("data:"))
            {
                buffer.kind = GltfLayout::Buffer::Kind::Inside;
                const std::size_t comma = buffer.uri.find(',');
                const std::string head = buffer.uri.substr(0, comma);
                std::optional<std::string> bytes;
                if (comma != std::string::npos && head.ends_with(";base64"))
                    bytes =
                        base64_decoded(std::string_view(buffer.uri).substr(comma + 1));
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
            fail(where, "byteLength: got " + std::to_string(size) + ", its data has " +
                            std::to_string(buffer.size));
        if (buffer.kind != GltfLayout::Buffer::Kind::Again)
            body_bytes_ += buffer.size;
        if (plan_)
            plan_->sources.back().inside = std::move(data);
        else
            out_.unpacked += data;
        declared_.push_back(size);
        layout_.buffers.push_back(std::move(buffer));
    }
    file_body_bytes_ = body_bytes_;
}

void GltfData::read_views()
{
    const GltfJson::Json& views = json_->list("bufferViews");
    for (std::size_t i = 0; i < views.size(); ++i)
    {
        const std::string where = element("bufferViews", i);
        const GltfJson::Json* number = json_->find(views[i], "buffer");
        if (!number)
            fail(where + ".buffer", "is missing");
        const std::size_t b = json_->index_of(*number, where + ".buffer", "buffers",
                                              layout_.buffers.size());
        const std::uint64_t offset = json_->count_of(views[i], "byteOffset", where, 0);
        GltfView view;
        view.length = json_->count_of(views[i], "byteLength", where);
        if (offset > declared_[b] || view.length > declared_[b] - offset)
            fail(where, "lies outside of its buffer (bytes " + std::to_string(offset) +
                            " and " + std::to_string(view.length) + " more of " +
                            std::to_string(declared_[b]) + ")");
        view.stride = json_->count_of(views[i], "byteStride", where, 0);
        if (views[i].contains("byteStride") && (view.stride < 4 || view.stride > 252))
            fail(where,
                 "byteStride: got " + std::to_string(view.stride) + ", need 4 to 252");
        const GltfJson::Json* const packed =
            json_->extension(views[i], kMeshoptExtension);
        view.is_compressed = packed != nullptr;
        layout_.is_packed = layout_.is_packed || packed;
        using Kind = GltfLayout::Buffer::Kind;
        if (packed && layout_.buffers[b].kind == Kind::Absent)
            make_room(b, where);
        if (layout_.buffers[b].kind == Kind::Absent)
            fail(element("buffers", b), "has no data");
        view.start = layout_.buffers[b].start + offset;
        if (packed && layout_.buffers[b].kind == Kind::Unpacked && !plan_)
            unpack_view(*packed, view, where + ".extensions." + kMeshoptExtension);
        views_.push_back(view);
    }
}

void GltfData::make_room(std::size_t buffer, const std::string& where)
{
    // All together no more than what the file's bytes can stand for.
    if (declared_[buffer] > (kMostOfPackedByte + 1) * file_body_bytes_ - body_bytes_)
        fail(element("buffers", buffer) + ".byteLength",
             "got " + std::to_string(declared_[buffer]) + ", more than " + where +
                 " and others can hold");
    GltfLayout::Buffer& room = layout_.buffers[buffer];
    room.kind = GltfLayout::Buffer::Kind::Unpacked;
    room.start = body_bytes_;
    room.size = declared_[buffer];
    body_bytes_ += room.size;
    if (!plan_)
        out_.unpacked.resize(static_cast<std::size_t>(body_bytes_), '\0');
}

std::string_view GltfData::compressed_bytes(const GltfJson::Json& place,
                                            const std::string& where) const
{
    const GltfJson::Json* const number = json_->find(place, "buffer");
    if (!number)
        fail(where + ".buffer", "is missing");
    const std::size_t b =
        json_->index_of(*number, where + ".buffer", "buffers", layout_.buffers.size());
    using Kind = GltfLayout::Buffer::Kind;
    const GltfLayout::Buffer& buffer = layout_.buffers[b];
    if (buffer.kind == Kind::Absent || buffer.kind == Kind::Unpacked)
        fail(element("buffers", b), "has no data");
    const std::uint64_t offset = json_->count_of(place, "byteOffset", where, 0),
                        length = json_->count_of(place, "byteLength", where);
    if (offset > declared_[b] || length > declared_[b] - offset)
        fail(where, "lies outside of its buffer (bytes " + std::to_string(offset) +
                        " and " + std::to_string(length) + " more of " +
                        std::to_string(declared_[b]) + ")");
    return std::string_view(out_.unpacked)
        .substr(static_cast<std::size_t>(buffer.start + offset),
                static_cast<std::size_t>(length));
}

void GltfData::unpack_view(const GltfJson::Json& packed, const GltfView& view,
                           const std::string& where)
{
    if (!packed.is_object())
        fail(where, "need an object");
    static const std::map<std::string, MeshoptView::Mode> modes = {
        {"ATTRIBUTES", MeshoptView::Mode::Attributes},
        {"TRIANGLES", MeshoptView::Mode::Triangles},
        {"INDICES", MeshoptView::Mode::Indices}};
    static const std::map<std::string, MeshoptView::Filter> filters = {
        {"NONE", MeshoptView::Filter::None},
        {"OCTAHEDRAL", MeshoptView::Filter::Octahedral},
        {"QUATERNION", MeshoptView::Filter::Quaternion},
        {"EXPONENTIAL", MeshoptView::Filter::Exponential}};
    MeshoptView what;
    const auto mode = modes.find(json_->text_of(packed, "mode", where));
    if (mode == modes.end())
        fail(where + ".mode", "is unknown");
    what.mode = mode->second;
    if (packed.contains("filter"))
    {
        const auto filter = filters.find(json_->text_of(packed, "filter", where));
        if (filter == filters.end())
            fail(where + ".filter", "is unknown");
        what.filter = filter->second;
    }
    what.count = json_->count_of(packed, "count", where);
    what.stride = json_->count_of(packed, "byteStride", where);
    const std::string_view bytes = compressed_bytes(packed, where);
    if (const std::string fault = what.fault(); !fault.empty())
        fail(where, fault);
    if (!what.may_come_from(bytes.size()) || what.count * what.stride > view.length)
        fail(where, std::to_string(what.count) + " elements of " +
                        std::to_string(what.stride) + " bytes are more than its " +
                        std::to_string(bytes.size()) + " bytes and its view can hold");
    std::string unpacked(static_cast<std::size_t>(what.count * what.stride), '\0');
    if (!unpack_meshopt(bytes, what, unpacked.data()))
        fail(where, "cannot be unpacked (damaged, or of another version)");
    out_.unpacked.replace(static_cast<std::size_t>(view.start), unpacked.size(),
                          unpacked);
}

std::size_t GltfData::accessor_of(const GltfJson::Json& value,
                                  const std::string& where) const
{
    return json_->index_of(value, where, "accessors", accessors().size());
}

void GltfData::unpack_primitives()
{
    const GltfJson::Json& meshes = json_->list("meshes");
    for (std::size_t m = 0; m < meshes.size(); ++m)
    {
        const GltfJson::Json* const primitives = json_->find(meshes[m], "primitives");
        if (!primitives || !primitives->is_array())
            continue; // the reader of meshes refuses it
        for (std::size_t p = 0; p < primitives->size(); ++p)
        {
            const GltfJson::Json& primitive = (*primitives)[p];
            const GltfJson::Json* const packed =
                primitive.is_object() ? json_->extension(primitive, kDracoExtension)
                                      : nullptr;
            if (packed)
                unpack_primitive(primitive, *packed,
                                 element("meshes", m) + "." + element("primitives", p));
        }
    }
}

void GltfData::unpack_primitive(const GltfJson::Json& primitive,
                                const GltfJson::Json& packed,
                                const std::string& primitive_name)
{
    layout_.is_packed = true;
    if (plan_)
        return;
    const std::string where = primitive_name + ".extensions." + kDracoExtension;
    const GltfJson::Json* const ids =
        packed.is_object() ? json_->find(packed, "attributes") : nullptr;
    const GltfJson::Json* const attributes = json_->find(primitive, "attributes");
    const GltfJson::Json* const indices = json_->find(primitive, "indices");
    if (!ids || !ids->is_object() || !attributes || !attributes->is_object())
        fail(where + ".attributes", "need an object, beside the primitive's own");
    std::vector<std::size_t> wanted;
    DracoWish wish;
    bool is_all_there = true; // as it is, or unpacked for another primitive
    for (const auto& [name, id] : ids->items())
    {
        const GltfJson::Json* const value = json_->find(*attributes, name.c_str());
        if (!value)
            fail(where + ".attributes", "the primitive has no " + in_quotes(name));
        const std::size_t number = accessor_of(*value, primitive_name + ": " + name);
        const GltfAccessor& accessor = accessors()[number];
        if (accessor.length > 4)
            fail(primitive_name + ": " + name, "has no type that Draco packs");
        is_all_there = is_all_there && accessor.has_data;
        if (!wanted.empty() && accessor.count != accessors()[wanted[0]].count)
            fail(where, "its attributes differ in count (accessors[" +
                            std::to_string(wanted[0]) + "] and accessors[" +
                            std::to_string(number) + "])");
        wanted.push_back(number);
        wish.attributes.push_back(
            {json_->count_of(id, where + "." + name), accessor.type, accessor.length});
        wish.vertices = accessor.count;
    }
    if (!indices || wanted.empty())
        fail(where, "need attributes and indices");
    const std::size_t number = accessor_of(*indices, primitive_name + ".indices");
    if (is_all_there && accessors()[number].has_data)
        return;
    if (json_->count_of(primitive, "mode", primitive_name, 4) != 4)
        fail(primitive_name + ".mode", "need triangles (4) for Draco");
    wish.triangles = accessors()[number].count / 3;
    wish.index_type = accessors()[number].type;
    if (accessors()[number].length != 1)
        fail(primitive_name + ".indices", "need a SCALAR");
    const GltfView& view = view_of(packed, where);
    std::string why;
    std::optional<DracoMesh> mesh =
        unpacked_draco(std::string_view(out_.unpacked)
                           .substr(static_cast<std::size_t>(view.start),
                                   static_cast<std::size_t>(view.length)),
                       wish, why);
    if (!mesh)
        fail(where, why);
    if (mesh->triangles == 0)
        fail(where, "holds no triangle");
    const auto put = [&](std::size_t which, std::uint64_t count, const std::string& bytes)
    {
        GltfAccessor& accessor = layout_.accessors[which];
        if (accessor.has_data)
            return;
        accessor.has_data = accessor.is_draco = true;
        accessor.count = count;
        accessor.stride = accessor.element_bytes();
        accessor.start = out_.unpacked.size();
        out_.unpacked += bytes;
        out_.unpacked.resize((out_.unpacked.size() + 7) / 8 * 8, '\0');
    };
    for (std::size_t k = 0; k < wanted.size(); ++k)
        put(wanted[k], mesh->vertices, mesh->attributes[k]);
    put(number, 3 * mesh->triangles, mesh->indices);
    body_bytes_ = out_.unpacked.size();
}

std::uint64_t GltfData::start_in(const GltfView& view, std::uint64_t offset,
                                 std::uint64_t stride, std::uint64_t count,
                                 std::uint64_t bytes, const std::string& where) const
{
    if (offset > view.length || bytes > view.length - offset ||
        (count - 1) > (view.length - offset - bytes) / stride)
        fail(where, "lies outside of its bufferView (" + std::to_string(count) +
                        " elements from byte " + std::to_string(offset) + " of " +
                        std::to_string(view.length) + ")");
    return view.start + offset;
}

Scalar GltfData::component_type(const GltfJson::Json& object,
                                const std::string& where) const
{
    switch (json_->count_of(object, "componentType", where))
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

const GltfView& GltfData::view_of(const GltfJson::Json& object,
                                  const std::string& where) const
{
    const GltfJson::Json* number = json_->find(object, "bufferView");
    if (!number)
        fail(where + ".bufferView", "is missing");
    return views_[json_->index_of(*number, where + ".bufferView", "bufferViews",
                                  views_.size())];
}

void GltfData::read_accessors()
{
    const GltfJson::Json& accessors = json_->list("accessors");
    for (std::size_t i = 0; i < accessors.size(); ++i)
    {
        const GltfJson::Json& object = accessors[i];
        const std::string where = element("accessors", i);
        GltfAccessor accessor;
        accessor.type = component_type(object, where);
        accessor.length = gltf_length(json_->text_of(object, "type", where));
        if (accessor.length == 0)
            fail(where + ".type", "is unknown");
        accessor.count = json_->count_of(object, "count", where);
        if (accessor.count == 0)
            fail(where + ".count", "got 0, need at least 1");
        if (const GltfJson::Json* normalised = json_->find(object, "normalized"))
            accessor.is_normalised = normalised->is_boolean() && normalised->get<bool>();
        if (object.contains("bufferView"))
        {
            const GltfView& view = view_of(object, where);
            accessor.has_data = true;
            accessor.is_compressed = view.is_compressed;
            accessor.stride = view.stride ? view.stride : accessor.element_bytes();
            if (accessor.stride < accessor.element_bytes())
                fail(where, "byteStride: got " + std::to_string(accessor.stride) +
                                ", its elements have " +
                                std::to_string(accessor.element_bytes()) + " bytes");
            accessor.start = start_in(
                view, json_->count_of(object, "byteOffset", where, 0), accessor.stride,
                accessor.count, accessor.element_bytes(), where);
        }
        if (const GltfJson::Json* sparse = json_->find(object, "sparse"))
            accessor.sparse = read_sparse(*sparse, accessor, where + ".sparse");
        layout_.accessors.push_back(accessor);
    }
}

GltfSparse GltfData::read_sparse(const GltfJson::Json& object,
                                 const GltfAccessor& accessor,
                                 const std::string& where) const
{
    GltfSparse sparse;
    const GltfJson::Json* indices =
        object.is_object() ? json_->find(object, "indices") : nullptr;
    const GltfJson::Json* values =
        object.is_object() ? json_->find(object, "values") : nullptr;
    if (!indices || !indices->is_object() || !values || !values->is_object())
        fail(where, "need indices and values");
    sparse.count = json_->count_of(object, "count", where);
    if (sparse.count == 0 || sparse.count > accessor.count)
        fail(where + ".count", "got " + std::to_string(sparse.count) + ", need 1 to " +
                                   std::to_string(accessor.count));
    sparse.index_type = component_type(*indices, where + ".indices");
    const std::size_t index_bytes = stored_size(sparse.index_type);
    sparse.indices = start_in(view_of(*indices, where + ".indices"),
                              json_->count_of(*indices, "byteOffset", where, 0),
                              index_bytes, sparse.count, index_bytes, where + ".indices");
    sparse.values = start_in(view_of(*values, where + ".values"),
                             json_->count_of(*values, "byteOffset", where, 0),
                             accessor.element_bytes(), sparse.count,
                             accessor.element_bytes(), where + ".values");
    return sparse;
}

void GltfData::check_zeros(std::size_t number) const
{
    const GltfAccessor& accessor = accessors()[number];
    if (!accessor.has_data && accessor.count > body_bytes_)
        fail(element("accessors", number),
             "has no bufferView (for " + std::to_string(accessor.count) + " elements)");
}

void GltfData::check_sparse(std::size_t number) const
{
    const GltfAccessor& accessor = accessors()[number];
    for (std::uint64_t i = 0; accessor.sparse && i < accessor.sparse->count; ++i)
    {
        const double index = sparse_index(*accessor.sparse, i, out_.unpacked);
        if (!(index >= 0 && index < static_cast<double>(accessor.count)))
            fail(element("accessors", number) + ".sparse.indices",
                 "is out of range (got " + shortest(index) + " of " +
                     std::to_string(accessor.count) + ")");
    }
}

std::vector<Eigen::Vector3d> GltfData::values_of(std::size_t number) const
{
    const GltfAccessor& accessor = accessors()[number];
    check_zeros(number);
    check_sparse(number);
    std::vector<Eigen::Vector3d> values(static_cast<std::size_t>(accessor.count),
                                        Eigen::Vector3d::Zero());
    const std::size_t length = std::min<std::size_t>(3, accessor.length);
    visit_elements(accessor, out_.unpacked,
                   [&](std::uint64_t at, std::size_t i)
                   {
                       for (std::size_t k = 0; k < length; ++k)
                           values[i][static_cast<Eigen::Index>(k)] =
                               stored(accessor, out_.unpacked,
                                      at + k * stored_size(accessor.type));
                   });
    return values;
}

std::vector<double> GltfData::numbers_of(std::size_t number) const
{
    check_zeros(number);
    check_sparse(number);
    return accessor_numbers(accessors()[number], out_.unpacked);
}

bool GltfData::do_overlap(const std::set<std::size_t>& changing) const
{
    std::vector<Span> spans;
    for (std::size_t i = 0; i < accessors().size(); ++i)
        if (const GltfAccessor& a = accessors()[i]; a.has_data)
            spans.push_back({a.start,
                             a.start + (a.count - 1) * a.stride + a.element_bytes(),
                             a.stride, a.element_bytes(), changing.contains(i)});
    std::sort(spans.begin(), spans.end(),
              [](const Span& a, const Span& b) { return a.start < b.start; });
    Columns fixed, moving;
    for (const Span& span : spans)
    {
        if (moving.clash(span) || (span.may_change && fixed.clash(span)))
            return true;
        (span.may_change ? moving : fixed).add(span);
    }
    return false;
}

} // namespace cellwarp::core
