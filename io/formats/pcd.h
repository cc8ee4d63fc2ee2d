// SPDX-License-Identifier: GPL-3.0-or-later
// Point Cloud Data: text, binary and compressed, any fields and types.
#pragma once

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

/// Reads a PCD part by part: the header in the first part, then whole points; of a
/// compressed one all points at once, from a file. A point whose x, y and z are all NaN
/// is one that the sensor did not see: it is no sample, and its bytes stay.
class PcdScanner
{
public:
    /// \p file_bytes: size of the whole file, to see through counts that lie.
    PcdScanner(std::string file, std::uint64_t file_bytes)
        : file_(std::move(file)), file_bytes_(file_bytes)
    {
    }

    std::size_t scan(std::string_view part, std::uint64_t start, bool is_last,
                     Geometry& out);
    std::size_t skip(std::string_view part);
    void finish(Geometry& out);

    // A compressed file may also be read without being unpacked into memory: its header,
    // the sizes, then any points from the columns that they stand in.

    /// A field of all points in the unpacked data: number i stands at start + i size.
    struct Column
    {
        std::uint64_t start = 0, size = 0; ///< [byte], [bytes]
        int role = -1;                     ///< see Field
    };
    /// Of the packed data that follow the sizes, and of what they are unpacked to.
    struct PackedSizes
    {
        std::uint32_t packed = 0, unpacked = 0; ///< [bytes]
    };
    /// Reads the header, which \p part must hold whole; its length [bytes].
    std::size_t read_header(std::string_view part, Geometry& out);
    /// The sizes at the beginning of \p part, byte \p start of the file, checked.
    PackedSizes packed_sizes(std::string_view part, std::uint64_t start) const;
    std::uint64_t num_points() const { return num_points_; }
    /// The fields that the geometry comes from.
    std::vector<Column> columns() const;
    /// Points [first, first + count) from their numbers, one string a column.
    void scan_columns(std::uint64_t first, std::uint64_t count,
                      const std::vector<std::string>& numbers, Geometry& out);
    /// All points are read, and \p trailing bytes follow the packed data.
    void end_columns(std::uint64_t trailing);

private:
    enum class Encoding
    {
        Text,
        Binary,
        Compressed
    };
    struct Field
    {
        std::string name;
        std::uint64_t size = 4, count = 1; ///< of a number [bytes]; numbers
        char kind = 'F';                   ///< F real, I signed, U unsigned
        int role = -1;                     ///< 0..2 position, 3..5 normal, 6 colour
        std::uint64_t offset = 0;          ///< in a point [bytes]

        std::optional<Scalar> type() const;
    };
    /// What one point gave.
    struct Point
    {
        double values[6] = {};
        Token numbers[6] = {};    ///< in the file
        std::uint32_t colour = 0; ///< 0xRRGGBB
    };

    std::size_t header(std::string_view part);
    void header_line(std::string_view line);
    void check_header();
    void assign_roles(Geometry& out);
    void text_point(std::string_view line, std::uint64_t start, Geometry& out);
    /// A number of the field, which stands at byte \p start.
    static void load(const char* bytes, std::uint64_t start, int role, Scalar type,
                     Point& point);
    /// Of points that stand one after the other from \p bytes on (binary), or field by
    /// field (compressed).
    void binary_point(std::string_view bytes, std::uint64_t start, Geometry& out);
    std::size_t unpack(std::string_view part, std::uint64_t start, bool is_last,
                       Geometry& out);
    void keep(const Point& point, Geometry& out);
    /// Tells \p out where the numbers of points stand; point 0 begins at byte \p start.
    void set_layout(std::uint64_t start, Geometry& out) const;
    Where here(std::uint64_t start, const std::string& field = {}) const;

    std::string file_;
    std::uint64_t file_bytes_;
    bool has_header_ = false, has_data_ = false;
    Encoding encoding_ = Encoding::Text;
    std::vector<Field> fields_;
    std::vector<std::string> sizes_, kinds_, counts_; ///< as the header spells them
    std::int64_t fields_line_ = 0, sizes_line_ = 0, kinds_line_ = 0, counts_line_ = 0,
                 points_line_ = 0;
    std::optional<std::uint64_t> width_, height_, promised_;
    std::uint64_t num_points_ = 0, point_bytes_ = 0, num_tokens_ = 0;
    bool has_normals_ = false, has_colours_ = false;
    std::uint64_t point_ = 0; ///< being read
    std::int64_t lines_ = 0;
    std::uint64_t last_byte_ = 0; ///< of what was read
    std::uint64_t trailing_ = 0;  ///< [bytes] after the last point
};

/// The two sizes before the packed data, each 4 bytes.
inline constexpr std::size_t kPackedSizesBytes = 8;
/// What is compressed at a time: a reference reaches no further back than the beginning
/// of its block, so that blocks may be packed in any order and without the others.
inline constexpr std::size_t kPackedBlockBytes = std::size_t(1) << 20;

/// Whether the file begins as a compressed PCD does.
bool is_packed_pcd(const InputFile& file);

/// The error for a compressed PCD whose packed data are too many for their size.
Error too_large_to_pack(const std::string& path);

/// The bytes of a compressed PCD with \p patch in place, compressed again. Where nothing
/// changes they are the file's.
std::string patched_pcd(const GeometryFile& file, const DeformedSamples& patch);

} // namespace cellwarp::core
