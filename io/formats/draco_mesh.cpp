// SPDX-License-Identifier: GPL-3.0-or-later
// Draco's decoders believe the counts that stand in the bytes. A count costs an encoder
// nothing, so the counts are compared with those of the glTF before anything is made for
// them: vertices and triangles before the connectivity, numbers of a vertex before the
// attributes.
#include "io/formats/draco_mesh.h"

#include <exception>
#include <limits>
#include <memory>

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

#include "io/formats/stored_number.h"

namespace cellwarp::core
{

namespace
{

/// Numbers of a vertex that no accessor asks for may take this much beside what is wished
/// [byte].
constexpr std::uint64_t kMostUnused = 64;

/// One of Draco's decoders that compares what it finds with what is wished.
template <class Decoder, bool vertices_first>
class Checked : public Decoder
{
public:
    Checked(const DracoWish& wish, std::string& why) : wish_(wish), why_(why) {}

protected:
    bool DecodeConnectivity() override
    {
        draco::DecoderBuffer ahead = *Decoder::buffer();
        std::uint32_t counts[2] = {};
        if (!draco::DecodeVarint(&counts[0], &ahead) ||
            !draco::DecodeVarint(&counts[1], &ahead))
            return false;
        const std::uint64_t vertices = counts[vertices_first ? 0 : 1],
                            triangles = counts[vertices_first ? 1 : 0];
        return are_in_bounds(vertices, triangles) && Decoder::DecodeConnectivity();
    }
    bool DecodeAllAttributes() override
    {
        const draco::PointCloud& found = *Decoder::point_cloud();
        // Corners that share a place may differ otherwise, and are more vertices then.
        if (!are_in_bounds(found.num_points(), 0))
            return false;
        std::uint64_t most = kMostUnused, bytes = 0;
        for (const DracoWish::Attribute& attribute : wish_.attributes)
            most += 2 * attribute.length * sizeof(double);
        for (int k = 0; k < found.num_attributes(); ++k)
            bytes += static_cast<std::uint64_t>(found.attribute(k)->byte_stride());
        if (bytes > most)
        {
            why_ = "holds " + std::to_string(bytes) + " bytes a vertex, need at most " +
                   std::to_string(most);
            return false;
        }
        return Decoder::DecodeAllAttributes();
    }

private:
    bool are_in_bounds(std::uint64_t vertices, std::uint64_t triangles) const
    {
        const auto is_more =
            [&](std::uint64_t count, std::uint64_t most, const char* what)
        {
            if (count > most)
                why_ = "holds " + std::to_string(count) + " " + what +
                       ", its accessors " + std::to_string(most);
            return count > most;
        };
        return !is_more(vertices, wish_.vertices, "vertices") &&
               !is_more(triangles, wish_.triangles, "triangles");
    }

    const DracoWish& wish_;
    std::string& why_;
};

template <class Number>
bool append_all(const draco::PointAttribute& attribute, std::uint32_t vertices,
                std::size_t length, std::string& out)
{
    std::vector<Number> values(length);
    out.reserve(vertices * length * sizeof(Number));
    for (std::uint32_t i = 0; i < vertices; ++i)
    {
        if (!attribute.ConvertValue(attribute.mapped_index(draco::PointIndex(i)),
                                    static_cast<std::int8_t>(length), values.data()))
            return false;
        out.append(reinterpret_cast<const char*>(values.data()), length * sizeof(Number));
    }
    return true;
}

bool append_as(Scalar type, const draco::PointAttribute& attribute,
               std::uint32_t vertices, std::size_t length, std::string& out)
{
    switch (type)
    {
    case Scalar::Int8:
        return append_all<std::int8_t>(attribute, vertices, length, out);
    case Scalar::UInt8:
        return append_all<std::uint8_t>(attribute, vertices, length, out);
    case Scalar::Int16:
        return append_all<std::int16_t>(attribute, vertices, length, out);
    case Scalar::UInt16:
        return append_all<std::uint16_t>(attribute, vertices, length, out);
    case Scalar::UInt32:
        return append_all<std::uint32_t>(attribute, vertices, length, out);
    default:
        return append_all<float>(attribute, vertices, length, out);
    }
}

std::unique_ptr<draco::MeshDecoder> decoder_of(std::string_view bytes,
                                               const DracoWish& wish, std::string& why)
{
    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    draco::DracoHeader header{};
    if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok())
        why = "is no Draco data";
    else if (header.encoder_type != draco::TRIANGULAR_MESH)
        why = "is no mesh";
    else if (header.version_major != 2 || header.version_minor != 2)
        why = "has version " + std::to_string(header.version_major) + "." +
              std::to_string(header.version_minor) + " of Draco's format, need 2.2";
    else if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING)
        return std::make_unique<Checked<draco::MeshSequentialDecoder, false>>(wish, why);
    else if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING)
        return std::make_unique<Checked<draco::MeshEdgebreakerDecoder, true>>(wish, why);
    else
        why = "is encoded by an unknown method";
    return nullptr;
}

bool decode(std::string_view bytes, const DracoWish& wish, draco::Mesh& mesh,
            std::string& why)
{
    const std::unique_ptr<draco::MeshDecoder> decoder = decoder_of(bytes, wish, why);
    if (!decoder)
        return false;
    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    const draco::DecoderOptions options;
    const draco::Status status = decoder->Decode(options, &buffer, &mesh);
    if (!status.ok() && why.empty())
        why = "cannot be unpacked (" + status.error_msg_string() + ")";
    return status.ok();
}

} // namespace

std::optional<DracoMesh> unpacked_draco(std::string_view bytes, const DracoWish& wish,
                                        std::string& why)
{
    why.clear();
    try
    {
        draco::Mesh mesh;
        if (!decode(bytes, wish, mesh, why))
            return std::nullopt;
        DracoMesh out;
        out.vertices = mesh.num_points();
        out.triangles = mesh.num_faces();
        out.indices.reserve(3 * out.triangles * stored_size(wish.index_type));
        for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f)
            for (const draco::PointIndex& corner : mesh.face(f))
                if (corner.value() >= out.vertices ||
                    !store(corner.value(), wish.index_type, false, out.indices))
                {
                    why = "has a corner " + std::to_string(corner.value()) +
                          ", which is out of range";
                    return std::nullopt;
                }
        for (const DracoWish::Attribute& wished : wish.attributes)
        {
            const draco::PointAttribute* const found =
                wished.id > std::numeric_limits<std::uint32_t>::max()
                    ? nullptr
                    : mesh.GetAttributeByUniqueId(static_cast<std::uint32_t>(wished.id));
            const std::string name = "attribute " + std::to_string(wished.id);
            if (!found)
                why = "has no " + name;
            else if (static_cast<std::size_t>(found->num_components()) != wished.length)
                why = name + " has " + std::to_string(int(found->num_components())) +
                      " numbers a vertex, need " + std::to_string(wished.length);
            else if (!append_as(wished.type, *found, mesh.num_points(), wished.length,
                                out.attributes.emplace_back()))
                why = name + " does not fit the type of its accessor";
            if (!why.empty())
                return std::nullopt;
        }
        return out;
    }
    catch (const std::exception& error)
    {
        // A count that the bytes lie about ends in one of the library's allocations.
        why = std::string("cannot be unpacked (") + error.what() + ")";
        return std::nullopt;
    }
}

} // namespace cellwarp::core
