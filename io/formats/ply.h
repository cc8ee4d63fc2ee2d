// SPDX-License-Identifier: GPL-3.0-or-later
// Stanford PLY: ascii and both binaries, any elements, properties and types.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/base/error.h"
#include "io/base/text.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Reads a PLY part by part: the header, which must be whole, then whole records.
class PlyScanner
{
public:
    /// \p file_bytes: size of the whole file, to see through counts that lie.
    PlyScanner(std::string file, std::uint64_t file_bytes)
        : file_(std::move(file)), file_bytes_(file_bytes)
    {
    }

    std::size_t scan(std::string_view part, std::uint64_t start, bool is_last,
                     Geometry& out);
    std::size_t skip(std::string_view part);
    void finish(Geometry& out);

    /// The vertices of a binary file: number i stands at start + i bytes.
    struct Vertices
    {
        std::uint64_t start = 0, bytes = 0, count = 0;
    };
    /// Reads the header, which \p part must hold whole. Nothing where vertices cannot be
    /// found without reading what stands before them.
    std::optional<Vertices> find_vertices(std::string_view part, Geometry& out);
    /// The next record to be scanned is vertex \p i.
    void seek_vertex(std::uint64_t i);

private:
    enum class Encoding
    {
        Ascii,
        Little,
        Big
    };
    struct Property
    {
        std::string name;
        Scalar type = Scalar::Float32;
        bool is_list = false;
        Scalar count_type = Scalar::UInt8;
        int role = -1; ///< what it means to us, see kNormal; -1: nothing
    };
    struct Element
    {
        std::string name;
        std::uint64_t count = 0;
        std::int64_t line = 0;
        std::vector<Property> properties;
        std::uint64_t min_bytes = 0; ///< of a record
        bool has_lists = false;
        bool has_normal = false, has_rotation = false, has_colour = false;
    };
    /// Roles: 0..2 position, 3..5 normal, 6..9 rotation, 10..12 colour; the corners of
    /// faces, of strips, of faces that have too few corners to be any.
    static constexpr int kNormal = 3, kRotation = 6, kColour = 10, kCornerList = 13,
                         kStripList = 14, kShortList = 15;
    /// A property with a role, in records of one size.
    struct Column
    {
        std::size_t offset = 0; ///< in the record [bytes]
        Scalar type = Scalar::Float32;
    };
    /// Of a strip of triangles: each corner makes one with the two before it, every other
    /// one of them turned over; -1 begins anew.
    struct Strip
    {
        std::uint32_t last[2] = {};
        std::uint64_t length = 0;
    };
    /// What one record gave.
    struct Record
    {
        double values[kCornerList];
        Token numbers[kColour]; ///< of a binary record only where they start
    };

    /// The role of a property that lists the corners of faces, or of strips; else -1.
    static int role_of_list(const std::string& element, const Property& property);
    std::size_t header(std::string_view part);
    bool next_element();
    void header_line(std::string_view line);
    void assign_roles(Geometry& out);
    bool ascii_record(const Element& element, std::string_view line, std::uint64_t start,
                      Geometry& out);
    /// False if the record is not complete in \p bytes.
    bool binary_record(const Element& element, std::string_view bytes,
                       std::uint64_t start, std::size_t& length, Geometry& out);
    void keep(const Element& element, const Record& record, Geometry& out);
    /// Vertices of a binary file, of one size, in \p records, which begins at byte
    /// \p start.
    void keep_fixed(const Element& element, std::string_view records, std::uint64_t start,
                    Geometry& out);
    /// A sample that has to be finite; false if it has no place.
    bool keep_sample(const double* x, const std::uint64_t* starts, Geometry& out) const;
    /// Adds the normal of the last sample; false if it is none.
    static bool keep_normal(const double* n, Geometry& out);
    static bool keep_rotation(const double* q, Geometry& out);
    /// Faces of a binary file whose records are one list of corners each, as long as
    /// they are whole in \p bytes. Returns how many bytes they take.
    std::size_t keep_faces(const Element& element, std::string_view bytes, Geometry& out);
    void add_to_strip(double index, std::uint64_t start, Strip& strip,
                      Geometry& out) const;
    void check_face(std::uint64_t count, std::uint64_t start) const;
    std::uint32_t corner(double index, std::uint64_t start) const;
    /// One of the corners of a face, or of a strip, by the role of the list.
    void add_corner(int role, double index, std::uint64_t start, Strip& strip,
                    Geometry& out) const;
    Where here(std::uint64_t start, const std::string& field = {}) const;

    std::string file_;
    std::uint64_t file_bytes_;
    bool has_header_ = false;
    Encoding encoding_ = Encoding::Ascii;
    bool has_format_ = false;
    std::vector<Element> elements_;
    std::uint64_t num_samples_ = 0;
    bool has_faces_ = false;
    std::array<Column, kCornerList> columns_ = {}; ///< of the vertices, by role
    std::size_t element_ = 0;                      ///< being read
    std::uint64_t record_ = 0;                     ///< of that element
    std::int64_t lines_ = 0;
    std::uint64_t trailing_ = 0; ///< [bytes] after the last record
};

} // namespace cellwarp::core
