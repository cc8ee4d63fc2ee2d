// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/gltf_data.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string_view>
#include <utility>

#include "io/base64.h"
#include "io/bytes.h"
#include "io/error.h"
#include "io/number.h"

namespace cellwarp
{

namespace
{

namespace fs = std::filesystem;

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
        return stride == other.stride && apart >= bytes && apart + other.bytes <= stride;
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

} // namespace

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
        view.is_compressed = json_->extension(views[i], "EXT_meshopt_compression");
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
    static const std::map<std::string, std::size_t> lengths = {
        {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
        {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
    const GltfJson::Json& accessors = json_->list("accessors");
    for (std::size_t i = 0; i < accessors.size(); ++i)
    {
        const GltfJson::Json& object = accessors[i];
        const std::string where = element("accessors", i);
        GltfAccessor accessor;
        accessor.type = component_type(object, where);
        const auto length = lengths.find(json_->text_of(object, "type", where));
        if (length == lengths.end())
            fail(where + ".type", "is unknown");
        accessor.length = length->second;
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
        accessors_.push_back(accessor);
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

double GltfData::stored(std::uint64_t at, const GltfAccessor& accessor) const
{
    const double value = load_stored(out_.unpacked.data() + at, accessor.type, false);
    return accessor.is_normalised ? fraction(value, accessor.type) : value;
}

void GltfData::check_zeros(std::size_t number) const
{
    const GltfAccessor& accessor = accessors_[number];
    if (!accessor.has_data && accessor.count > body_bytes_)
        fail(element("accessors", number),
             "has no bufferView (for " + std::to_string(accessor.count) + " elements)");
}

template <class Load>
void GltfData::visit_elements(std::size_t number, Load&& load) const
{
    const GltfAccessor& accessor = accessors_[number];
    for (std::uint64_t i = 0; accessor.has_data && i < accessor.count; ++i)
        load(accessor.start + i * accessor.stride, static_cast<std::size_t>(i));
    if (!accessor.sparse)
        return;
    const GltfSparse& sparse = *accessor.sparse;
    for (std::uint64_t i = 0; i < sparse.count; ++i)
    {
        const double index = load_stored(out_.unpacked.data() + sparse.indices +
                                             i * stored_size(sparse.index_type),
                                         sparse.index_type, false);
        if (!(index >= 0 && index < static_cast<double>(accessor.count)))
            fail(element("accessors", number) + ".sparse.indices",
                 "is out of range (got " + shortest(index) + " of " +
                     std::to_string(accessor.count) + ")");
        load(sparse.values + i * accessor.element_bytes(),
             static_cast<std::size_t>(index));
    }
}

std::vector<Eigen::Vector3d> GltfData::values_of(std::size_t number) const
{
    const GltfAccessor& accessor = accessors_[number];
    check_zeros(number);
    std::vector<Eigen::Vector3d> values(static_cast<std::size_t>(accessor.count),
                                        Eigen::Vector3d::Zero());
    const std::size_t length = std::min<std::size_t>(3, accessor.length);
    visit_elements(number,
                   [&](std::uint64_t at, std::size_t i)
                   {
                       for (std::size_t k = 0; k < length; ++k)
                           values[i][static_cast<Eigen::Index>(k)] =
                               stored(at + k * stored_size(accessor.type), accessor);
                   });
    return values;
}

std::vector<double> GltfData::numbers_of(std::size_t number) const
{
    const GltfAccessor& accessor = accessors_[number];
    check_zeros(number);
    std::vector<double> numbers(
        static_cast<std::size_t>(accessor.count) * accessor.length, 0.0);
    visit_elements(number,
                   [&](std::uint64_t at, std::size_t i)
                   {
                       for (std::size_t k = 0; k < accessor.length; ++k)
                           numbers[i * accessor.length + k] =
                               stored(at + k * stored_size(accessor.type), accessor);
                   });
    return numbers;
}

std::string GltfData::overlap(const std::set<std::size_t>& changing) const
{
    std::vector<Span> spans;
    for (std::size_t i = 0; i < accessors_.size(); ++i)
        if (const GltfAccessor& a = accessors_[i]; a.has_data)
            spans.push_back({a.start,
                             a.start + (a.count - 1) * a.stride + a.element_bytes(),
                             a.stride, a.element_bytes(), i, changing.contains(i)});
    std::sort(spans.begin(), spans.end(),
              [](const Span& a, const Span& b) {
                  return std::pair(a.start, a.accessor) < std::pair(b.start, b.accessor);
              });
    Columns fixed, moving;
    for (const Span& span : spans)
    {
        const Span* other = moving.clash(span);
        if (!other && span.may_change)
            other = fixed.clash(span);
        if (other)
            return "accessors[" + std::to_string(other->accessor) + "] and accessors[" +
                   std::to_string(span.accessor) + "] share bytes";
        (span.may_change ? moving : fixed).add(span);
    }
    return {};
}

} // namespace cellwarp
