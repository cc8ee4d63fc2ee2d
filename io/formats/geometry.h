// SPDX-License-Identifier: GPL-3.0-or-later
// Geometry as plain values: samples, faces and directions, and the place in its file of
// every number that a deformation changes.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/offsets.h"
#include "io/base/text.h"

namespace cellwarp::core
{

/// How a number is stored in the bytes.
enum class Scalar : std::uint8_t
{
    Text,     ///< a decimal token
    TextInt,  ///< a decimal token that must stay an integer (ascii PLY)
    TextReal, ///< a decimal token that must not look like an integer (normals in columns)
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Float32,
    Float64
};

/// The numbers of vectors of one length, for a whole list of them: where in the bytes
/// they stand and how they are stored. Number k of vector i has the number length * i +
/// k. The places are listed one by one, or computed from those of records.
struct ByteOffsets
{
    std::size_t length = 3; ///< at most 4
    std::array<Scalar, 4> scalars = {Scalar::Text, Scalar::Text, Scalar::Text,
                                     Scalar::Text};
    bool big_endian = false;
    Offsets starts = {};       ///< [byte]; empty if they are computed
    TokenLengths lengths = {}; ///< of numbers that are text, as their scanner read them
    RecordPlaces records = {}; ///< empty if they are listed

    bool is_text() const
    {
        return scalars[0] == Scalar::Text || scalars[0] == Scalar::TextInt ||
               scalars[0] == Scalar::TextReal;
    }
    std::uint64_t start(std::size_t number) const ///< [byte]
    {
        return records.empty() ? starts[number]
                               : records.start(number / length, number % length);
    }
    /// Writes the starts of all numbers of vector \p i.
    void starts_of(std::size_t i, std::uint64_t* out) const
    {
        if (!records.empty())
            return records.starts(i, length, out);
        for (std::size_t k = 0; k < length; ++k)
            out[k] = starts[length * i + k];
    }
    /// Lists the numbers of a vector: \p tokens holds length of them.
    void add(const Token* tokens)
    {
        for (std::size_t k = 0; k < length; ++k)
        {
            starts.push_back(tokens[k].start);
            if (is_text())
                lengths.push_back(tokens[k].text.size());
        }
    }
    /// Keeps the first \p count listed vectors.
    void truncate(std::size_t count)
    {
        starts.truncate(length * count);
        if (is_text())
            lengths.truncate(length * count);
    }
    /// Removes all places, but not how numbers are stored.
    void clear()
    {
        starts.clear();
        lengths.clear();
        records.clear();
    }

    bool operator==(const ByteOffsets&) const = default;
};

/// Faces of one OBJ group or object; a name may come back.
struct FaceGroup
{
    std::string name;
    std::size_t first_face = 0;
    std::size_t end_face = 0;
};

inline constexpr std::uint32_t kNone = 0xffffffffu;

/// What a scanner found. Samples are in file order.
struct Geometry
{
    std::string format;                   ///< "obj", "ply", ...
    std::vector<Eigen::Vector3d> samples; ///< [model unit]
    std::vector<std::uint32_t> corners;   ///< sample index of every face corner
    Offsets face_ends; ///< face f: corners [face_ends[f-1], face_ends[f])
    /// OBJ: what is drawn from sample to sample.
    std::vector<std::array<std::uint32_t, 2>> lines;

    /// Normals. In an OBJ a pool that the corners index; elsewhere direction i
    /// belongs to sample direction_samples[i].
    std::vector<Eigen::Vector3d> directions;
    std::vector<std::uint32_t> direction_samples;
    std::vector<std::uint32_t> corner_directions; ///< OBJ: direction or kNone, a corner
    Offsets corner_direction_starts;              ///< [byte] of that index
    TokenLengths corner_direction_lengths;        ///< [bytes] of that index
    /// OBJ: how many decimals the directions are written with, at most kMostDecimals.
    int direction_decimals = 0;
    static constexpr int kMostDecimals = 6;

    /// Tangents: tangent i belongs to sample tangent_samples[i].
    std::vector<Eigen::Vector3d> tangents;
    std::vector<std::uint32_t> tangent_samples;
    /// Rotations of samples that are more than a point (Gaussian splats), as
    /// quaternions w x y z of any length but 0.
    std::vector<Eigen::Vector4d> rotations;
    std::vector<std::uint32_t> rotation_samples;

    std::vector<std::array<std::uint8_t, 3>> colours; ///< empty, or one a sample
    std::vector<FaceGroup> groups;
    std::vector<std::string> attributes; ///< what else a sample or face carries
    std::vector<std::string> columns;    ///< XYZ and the like: what each is taken for
    std::vector<std::string> warnings;

    ByteOffsets sample_places;
    ByteOffsets direction_places;
    ByteOffsets tangent_places;
    ByteOffsets rotation_places = {4};

    /// Where the file packs its numbers: what they are unpacked to, which the places
    /// count in. Empty: they count in the file's bytes.
    std::string unpacked;
    std::uint64_t packed_start = 0; ///< PCD: of the compressed part [byte]
    /// Why the file cannot be written with samples elsewhere; empty: it can.
    std::string not_writable;

    /// Of a file that is read part by part: what earlier parts held. The corners of
    /// an OBJ count from the file's first sample, all other indices from this part's.
    std::uint64_t samples_before = 0, directions_before = 0;
    /// Counts of non-finite values, kept as they are; points without a place.
    std::size_t num_bad_normals = 0, num_bad_rotations = 0, num_missing = 0;

    /// Up to here, with the earlier parts.
    std::uint64_t num_samples() const { return samples_before + samples.size(); }
    std::uint64_t num_directions() const { return directions_before + directions.size(); }
    std::size_t num_faces() const { return face_ends.size(); }
    std::span<const std::uint32_t> face(std::size_t f) const
    {
        const std::size_t first = f == 0 ? 0 : face_ends[f - 1];
        return std::span(corners).subspan(first, face_ends[f] - first);
    }
    /// That the faces are cut into: n - 2 of a face of n corners, see face_triangles.h.
    std::size_t num_triangles() const { return corners.size() - 2 * face_ends.size(); }
};

struct GltfLayout;

/// A geometry file in memory. Immutable while it is shared.
struct GeometryFile
{
    std::string path;
    std::string bytes;
    Geometry geometry;
    std::shared_ptr<const GltfLayout> gltf = nullptr; ///< of a glTF, see gltf.h
};

/// What is in it, which keeps the file.
inline std::shared_ptr<const Geometry>
geometry_of(std::shared_ptr<const GeometryFile> file)
{
    const Geometry* const geometry = &file->geometry;
    return {std::move(file), geometry};
}

struct ReadOptions
{
    std::string columns; ///< of text in columns, see ColumnsScanner
};

/// A direction as one of its samples sees it. An OBJ's vn that several samples
/// share has several uses.
struct DirectionUse
{
    std::uint32_t direction;
    std::uint32_t sample;
};

/// An OBJ index that is replaced by another.
struct IndexEdit
{
    std::uint64_t start; ///< [byte]
    std::size_t length;  ///< of the old one [bytes]
    std::uint32_t index; ///< 1-based
};

/// Every pair of direction and sample that occurs, once, sorted.
/// None for an STL, whose normals follow from its corners.
std::vector<DirectionUse> direction_uses(const Geometry& geometry);

/// Throws Fault::Malformed if a coordinate is beyond 1e150: its square overflows.
void check_magnitude(const std::string& path, const Geometry& geometry);

/// Checks geometry that no reader has made. Throws Fault::Malformed with the first wrong
/// number as field ("faces[17][2]"): there must be a sample; coordinates are finite and
/// within 1e150; a face has three corners or more; indices are in range; normals and
/// tangents are finite, and so are rotations, which have a length.
void check_geometry(const Geometry& geometry);

/// What a deformation changes, in the order of the file.
struct DeformedSamples
{
    std::vector<Eigen::Vector3d> samples;    ///< as many as the geometry's
    std::vector<Eigen::Vector3d> directions; ///< one for each of direction_uses()
    /// As many as the geometry's, or none: then they stay.
    std::vector<Eigen::Vector3d> tangents = {};
    std::vector<Eigen::Vector4d> rotations = {};
};

} // namespace cellwarp::core
