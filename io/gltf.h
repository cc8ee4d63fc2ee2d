// SPDX-License-Identifier: GPL-3.0-or-later
// glTF 2.0, as JSON with buffers inside or beside it (.gltf) or as one binary (.glb).
// [glTF2]
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "io/geometry.h"
#include "io/json_text.h"

namespace cellwarp
{

/// A companion of a file: it stands beside it and holds some of its numbers.
struct Companion
{
    std::string path;
    std::string bytes;
};

/// Where in a glTF file what a patch changes is packed. Geometry::unpacked holds its
/// buffers one after the other.
struct GltfLayout
{
    struct Buffer
    {
        enum class Kind
        {
            Inside, ///< base64 in the JSON
            Beside, ///< a file in the same folder or below
            Chunk,  ///< of the binary container
            Absent
        };
        Kind kind = Kind::Absent;
        std::uint64_t start = 0, size = 0; ///< in Geometry::unpacked [byte]
        std::string uri;
        std::string path; ///< of the file beside
    };
    /// Samples, directions and tangents of one node: [first, end) of each, and its map
    /// from its own space to the world's, x -> linear x + shift.
    struct Part
    {
        std::size_t first[3] = {}, end[3] = {};
        Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
        Eigen::Vector3d shift = Eigen::Vector3d::Zero();

        bool is_in_place() const { return linear.isIdentity(0) && shift.isZero(0); }
    };
    /// An accessor whose numbers may change: real ones of 4 bytes.
    struct Data
    {
        std::size_t accessor = 0;
        std::uint64_t start = 0, stride = 0, count = 0; ///< in Geometry::unpacked [byte]
        std::size_t length = 3;                         ///< numbers of an element
    };

    TextRange json;                ///< in the file's bytes
    std::uint64_t chunk_start = 0; ///< of the binary chunk's data; 0: none [byte]
    std::vector<Buffer> buffers;
    std::vector<Part> parts;
    std::vector<Data> data;
};

/// Reads all of \p file.bytes; buffers beside it are read from its folder.
void scan_gltf(GeometryFile& file);

/// A glTF and what stands beside it.
struct PatchedGltf
{
    std::string bytes;
    std::vector<Companion> companions;
};

/// A glTF with \p patch in place, as it is saved under the name \p output: its buffers
/// beside it become companions that are named after it. Without a name they are left
/// out, and the file goes on naming the old ones.
/// Throws Fault::Malformed if the file is not writable and something moves.
PatchedGltf patched_gltf(const GeometryFile& file, const Patch& patch,
                         const std::string& output);

/// The paths of those companions.
std::vector<std::string> companion_paths(const GltfLayout& layout,
                                         const std::string& output);

} // namespace cellwarp
