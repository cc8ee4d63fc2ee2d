// SPDX-License-Identifier: GPL-3.0-or-later
// glTF 2.0, as JSON with buffers inside or beside it (.gltf) or as one binary (.glb).
// [glTF2]
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/json_text.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// A companion of a file: it stands beside it and holds some of its numbers.
struct Companion
{
    std::string path;
    std::string bytes;
};

/// Elements of an accessor that stand elsewhere than the others.
struct GltfSparse
{
    std::uint64_t count = 0, indices = 0, values = 0; ///< starts [byte]
    Scalar index_type = Scalar::UInt8;
};

/// Type and place of numbers: starts count in Geometry::unpacked.
struct GltfAccessor
{
    Scalar type = Scalar::Float32;
    std::size_t length = 1;                         ///< numbers of an element
    std::uint64_t count = 0, start = 0, stride = 0; ///< [byte]
    bool is_normalised = false;
    bool is_compressed = false; ///< by meshopt, in the file
    bool is_draco = false;      ///< by Draco, in the file
    bool has_data = false;      ///< else it is all zeros
    std::optional<GltfSparse> sparse;

    std::size_t element_bytes() const;
    /// Whether its numbers stand in the file as a patch writes them.
    bool is_plain() const
    {
        return has_data && !sparse && !is_compressed && !is_draco &&
               type == Scalar::Float32;
    }
};

/// All numbers of all elements; \p body holds the buffers. What is sparse must have been
/// checked.
std::vector<double> accessor_numbers(const GltfAccessor& accessor, std::string_view body);

/// Where in a glTF file what a patch changes is packed. Geometry::unpacked holds its
/// buffers one after the other, then what is unpacked of compressed data.
struct GltfLayout
{
    struct Buffer
    {
        enum class Kind
        {
            Inside,   ///< base64 in the JSON
            Beside,   ///< a file in the same folder or below
            Chunk,    ///< of the binary container
            Again,    ///< a file beside that an earlier buffer has read: `twin`
            Unpacked, ///< of views that meshopt has compressed: the file has no bytes
            Absent
        };
        Kind kind = Kind::Absent;
        std::uint64_t start = 0, size = 0; ///< in Geometry::unpacked [byte]
        std::string uri;
        std::string path;     ///< of the file beside
        std::size_t twin = 0; ///< the buffer whose bytes these are
    };
    /// The elements of one accessor in one part, as they became samples (list 0),
    /// directions (1) or tangents (2).
    struct Run
    {
        std::size_t list = 0, accessor = 0;
        std::size_t first = 0, end = 0;        ///< in that list of the geometry
        std::size_t position = 0, samples = 0; ///< accessor and first of its samples
    };
    /// One mesh at one place of the scene, and its map from its own space to the world's.
    struct Part
    {
        std::size_t node = 0, mesh = 0;
        std::optional<std::size_t> gpu_instance; ///< of the node, else it is the only one
        std::vector<Run> runs;
        Eigen::Affine3d to_world = Eigen::Affine3d::Identity();
        Eigen::Matrix3d of_normals = Eigen::Matrix3d::Identity(); ///< to the world

        bool is_in_place() const { return to_world.matrix().isIdentity(0); }
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
    std::vector<GltfAccessor> accessors;
    std::vector<Part> parts;
    std::vector<Data> data;
    /// For each accessor the number of runs and others that read its numbers; 0: no run
    /// does.
    std::vector<std::size_t> uses;
    bool does_overlap = false; ///< some accessor reads where numbers of another one move
    bool is_packed = false;    ///< some data are compressed
    /// Whether all that may move is patched where it stands. Else some of it is written
    /// elsewhere, see gltf_rebuild.h.
    bool is_patched = true;

    /// Whether the accessor holds the numbers of one run, in the file and of no other
    /// use.
    bool is_own(std::size_t accessor) const
    {
        return uses[accessor] == 1 && accessors[accessor].is_plain() && !does_overlap;
    }
};

/// What of a glTF is moved, without its numbers: for files larger than the memory.
struct GltfPlan
{
    /// Positions, and what hangs on them element by element.
    struct Run
    {
        GltfLayout::Data samples;
        std::vector<GltfLayout::Data> directions, tangents;
        std::size_t part = 0; ///< of the layout
    };
    /// Indices of a primitive, which are still to be checked.
    struct Indices
    {
        GltfLayout::Data data;
        Scalar type = Scalar::UInt32;
        std::uint64_t samples = 0; ///< each index is below
        std::string where;
    };
    /// Where a buffer's bytes come from: the text, a file beside, or (with neither) the
    /// file itself.
    struct Source
    {
        std::string inside;
        std::unique_ptr<InputFile> file;
    };
    std::vector<Run> runs;
    std::vector<Indices> indices;
    std::vector<Source> sources; ///< of each buffer
};

/// A plan of \p input. \p file holds its beginning, up to the end of the JSON, and gets
/// all that scan_gltf() finds but what numbers tell. It is to be used only if the layout
/// says that all is in place.
GltfPlan plan_gltf(GeometryFile& file, const InputFile& input);

/// A normal or tangent of a node in the world, as long as it was; \p map takes it there.
Eigen::Vector3d turned_to_world(const Eigen::Matrix3d& map,
                                const Eigen::Vector3d& vector);

Error vertex_not_finite(const std::string& path, const GltfLayout::Data& data,
                        std::uint64_t i);
Error index_out_of_range(const std::string& path, const std::string& primitive,
                         std::uint64_t i, double index, std::uint64_t samples);
void warn_of_bad_vectors(const std::string& path, std::uint64_t count, Geometry& out);

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
PatchedGltf patched_gltf(const GeometryFile& file, const DeformedSamples& patch,
                         const std::string& output);

// --- what a glTF in memory and one in ranges have in common
// -----------------------------

/// The inverse of a node's map: vectors of the world as the node has them.
class GltfToNode
{
public:
    explicit GltfToNode(const GltfLayout::Part& part);
    Eigen::Vector3d sample(const Eigen::Vector3d& x) const;
    Eigen::Vector3d direction(const Eigen::Vector3d& n) const;
    Eigen::Vector3d tangent(const Eigen::Vector3d& t) const;

private:
    bool is_in_place_;
    Eigen::Matrix3d linear_, inverse_;
    Eigen::Vector3d shift_;
};

/// The smallest and largest of each number of an accessor's elements.
class GltfBounds
{
public:
    explicit GltfBounds(const GltfLayout::Data& data);
    void add(const char* element);
    std::size_t accessor() const { return accessor_; }
    std::vector<double> least() const { return least_; }
    std::vector<double> most() const;

private:
    std::size_t accessor_;
    std::vector<double> least_, minus_most_;
};

/// The JSON with other bounds, and with other URIs of the buffers where they differ. One
/// whose length has changed is padded for a binary container.
std::string patched_json(std::string_view json, const GltfLayout& layout,
                         const std::vector<GltfBounds>& bounds,
                         const std::vector<std::string>& uris, bool is_binary);

/// The beginning of a binary container, up to its JSON, for a JSON of another length.
std::string glb_head(std::string_view bytes, TextRange old_json, std::size_t json_bytes);

/// A file's URI in a glTF beside it.
std::string uri_of(const std::string& path);
/// The URI of a buffer that names an earlier one's file, when that has its new one.
std::string uri_again(const GltfLayout& layout, const std::vector<std::string>& uris,
                      const GltfLayout::Buffer& buffer);
/// A data URI with other bytes.
std::string patched_data_uri(const std::string& uri, std::string_view before,
                             std::string_view after);

/// The paths of those companions.
std::vector<std::string> companion_paths(const GltfLayout& layout,
                                         const std::string& output);

} // namespace cellwarp::core
