// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes that Draco has compressed, as a glTF holds them: triangles and numbers of
// vertices, unpacked to the types that the glTF says. [KHR_draco_mesh_compression]
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// The content that a file declares for compressed bytes. They may hold fewer vertices
/// and triangles: encoders leave out triangles without area.
struct DracoWish
{
    struct Attribute
    {
        std::uint64_t id = 0; ///< Draco's own
        Scalar type = Scalar::Float32;
        std::size_t length = 1; ///< numbers of a vertex
    };
    std::uint64_t vertices = 0, triangles = 0; ///< at most
    Scalar index_type = Scalar::UInt32;
    std::vector<Attribute> attributes;
};

struct DracoMesh
{
    std::uint64_t vertices = 0, triangles = 0;
    std::string indices;                 ///< three of each triangle, of the wished type
    std::vector<std::string> attributes; ///< of all vertices, little-endian, no padding
};

/// Unpacks \p bytes. Takes no memory but in proportion to what is wished. Without a
/// result \p why is the reason, as the end of a message about the bytes.
std::optional<DracoMesh> unpacked_draco(std::string_view bytes, const DracoWish& wish,
                                        std::string& why);

} // namespace cellwarp::core
