// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/pcd.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "io/base/file_limits.h"
#include "io/base/lzf.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/packed.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kMaxFields = 1024;
/// Largest COUNT of a field: a point stays below 2^42 bytes.
constexpr std::int64_t kMaxCount = std::int64_t(1) << 28;

constexpr std::string_view kRoles[6] = {"x",        "y",        "z",
                                        "normal_x", "normal_y", "normal_z"};

std::uint32_t as_colour(double value, char kind)
{
    if (kind == 'F')
        return std::bit_cast<std::uint32_t>(static_cast<float>(value)) & 0xffffffu;
    return value >= 0 && value <= 4294967295.0
               ? static_cast<std::uint32_t>(value) & 0xffffffu
               : 0u;
}

} // namespace

std::optional<Scalar> PcdScanner::Field::type() const
{
    switch (kind)
    {
    case 'F':
        return size == 4   ? std::optional(Scalar::Float32)
               : size == 8 ? std::optional(Scalar::Float64)
                           : std::nullopt;
    case 'I':
        return size == 1   ? std::optional(Scalar::Int8)
               : size == 2 ? std::optional(Scalar::Int16)
               : size == 4 ? std::optional(Scalar::Int32)
                           : std::nullopt;
    default:
        return size == 1   ? std::optional(Scalar::UInt8)
               : size == 2 ? std::optional(Scalar::UInt16)
               : size == 4 ? std::optional(Scalar::UInt32)
                           : std::nullopt;
    }
}

Where PcdScanner::here(std::uint64_t start, const std::string& field) const
{
    std::string place = "point " + std::to_string(point_);
    if (encoding_ != Encoding::Text)
        place += " (byte " + std::to_string(start) +
                 (encoding_ == Encoding::Compressed ? " of the unpacked data)" : ")");
    if (!field.empty())
        place += ": " + field;
    return {file_, encoding_ == Encoding::Text ? lines_ : 0, place};
}

void PcdScanner::header_line(std::string_view line)
{
    Tokens tokens(line, 0);
    Token key;
    if (!tokens.next(key) || key.text[0] == '#')
        return;
    const Where where{file_, lines_, std::string(key.text.substr(0, 40))};
    std::vector<std::string> words;
    for (Token token; tokens.next(token);)
        words.emplace_back(token.text);
    const auto count = [&]() -> std::uint64_t
    {
        const std::optional<std::int64_t> value =
            words.size() == 1 ? parse_integer(words[0]) : std::nullopt;
        if (!value || *value < 0)
            throw malformed(where, "is no count (got " + in_quotes(line) + ")");
        return static_cast<std::uint64_t>(*value);
    };
    if (key.text == "VERSION")
    {
        const std::optional<double> version =
            words.size() == 1 ? parse_double(words[0]) : std::nullopt;
        if (!version || !(*version >= 0.5 && *version <= 0.7))
            throw malformed(where,
                            "is unknown (got " + in_quotes(line) + ", need 0.5 to 0.7)");
    }
    else if (key.text == "FIELDS" || key.text == "COLUMNS")
    {
        if (!fields_.empty() || words.empty() || words.size() > kMaxFields)
            throw malformed(where, "got " + in_quotes(line) +
                                       ", need one line of 1 to 1024 names");
        for (const std::string& word : words)
            fields_.emplace_back().name = word;
        fields_line_ = lines_;
    }
    else if (key.text == "SIZE")
    {
        sizes_ = std::move(words);
        sizes_line_ = lines_;
    }
    else if (key.text == "TYPE")
    {
        kinds_ = std::move(words);
        kinds_line_ = lines_;
    }
    else if (key.text == "COUNT")
    {
        counts_ = std::move(words);
        counts_line_ = lines_;
    }
    else if (key.text == "WIDTH")
        width_ = count();
    else if (key.text == "HEIGHT")
        height_ = count();
    else if (key.text == "POINTS")
    {
        promised_ = count();
        points_line_ = lines_;
    }
    else if (key.text == "DATA")
    {
        has_data_ = true;
        if (words.size() == 1 && words[0] == "ascii")
            encoding_ = Encoding::Text;
        else if (words.size() == 1 && words[0] == "binary")
            encoding_ = Encoding::Binary;
        else if (words.size() == 1 && words[0] == "binary_compressed")
            encoding_ = Encoding::Compressed;
        else
            throw malformed(where, "is unknown (got " + in_quotes(line) +
                                       ", need ascii, binary or binary_compressed)");
    }
    else if (key.text != "VIEWPOINT")
        throw malformed({file_, lines_, "header"},
                        "this is no PCD header line (got " + in_quotes(line) + ")");
}

namespace
{

/// Whether the header goes on after \p part.
bool is_pcd_header_open(std::string_view part)
{
    for (std::size_t next = byte_order_mark(part); next < kMaxHeaderBytes;)
    {
        const std::size_t end = part.find('\n', next);
        if (end == std::string_view::npos)
            return part.size() < kMaxHeaderBytes;
        Tokens tokens(part.substr(next, end - next), 0);
        if (Token key; tokens.next(key) && key.text == "DATA")
            return false;
        next = end + 1;
    }
    return false;
}

} // namespace

std::size_t PcdScanner::header(std::string_view part)
{
    const std::size_t mark = byte_order_mark(part);
    const std::string_view text = part.substr(mark, kMaxHeaderBytes);
    std::size_t next = 0;
    while (!has_data_)
    {
        const std::size_t end = text.find('\n', next);
        if (end == std::string_view::npos)
            throw malformed({file_, lines_ + 1, "header"}, text.size() == kMaxHeaderBytes
                                                               ? "is longer than 1 MB"
                                                               : "ends before DATA");
        std::string_view line = text.substr(next, end - next);
        if (!line.empty() && line.back() == '\r')
            line.remove_suffix(1);
        ++lines_;
        header_line(line);
        next = end + 1;
    }
    return mark + next;
}

void PcdScanner::check_header()
{
    const auto check_number =
        [&](const char* key, std::int64_t line, const std::vector<std::string>& words)
    {
        if (words.size() != fields_.size())
            throw malformed({file_, line, key},
                            "got " + std::to_string(words.size()) + " words, need " +
                                std::to_string(fields_.size()) + ", one a field");
    };
    if (fields_.empty())
        throw malformed({file_, 0, "header"}, "no FIELDS line");
    check_number("SIZE", sizes_line_, sizes_);
    check_number("TYPE", kinds_line_, kinds_);
    if (counts_.empty())
        counts_.assign(fields_.size(), "1");
    check_number("COUNT", counts_line_, counts_);
    for (std::size_t i = 0; i < fields_.size(); ++i)
    {
        Field& field = fields_[i];
        const std::optional<std::int64_t> size = parse_integer(sizes_[i]),
                                          count = parse_integer(counts_[i]);
        if (!size || (*size != 1 && *size != 2 && *size != 4 && *size != 8))
            throw malformed({file_, sizes_line_, "SIZE"},
                            "of " + in_quotes(field.name) + ": got " +
                                in_quotes(sizes_[i]) + ", need 1, 2, 4 or 8");
        if (kinds_[i] != "F" && kinds_[i] != "I" && kinds_[i] != "U")
            throw malformed({file_, kinds_line_, "TYPE"},
                            "of " + in_quotes(field.name) + ": got " +
                                in_quotes(kinds_[i]) + ", need F, I or U");
        if (!count || *count < 1 || *count > kMaxCount)
            throw malformed({file_, counts_line_, "COUNT"},
                            "of " + in_quotes(field.name) + ": got " +
                                in_quotes(counts_[i]) + ", need 1 to 268435456");
        field.size = static_cast<std::uint64_t>(*size);
        field.count = static_cast<std::uint64_t>(*count);
        field.kind = kinds_[i][0];
        field.offset = point_bytes_;
        point_bytes_ += field.size * field.count;
        num_tokens_ += field.count;
    }
    if (!width_ && !promised_)
        throw malformed({file_, 0, "header"}, "neither WIDTH nor POINTS");
    const std::uint64_t height = height_.value_or(1);
    num_points_ = width_.value_or(promised_.value_or(0));
    if (width_)
    {
        if (height > 0 && num_points_ > kMaxSamples / height)
            throw malformed({file_, 0, "header"},
                            "WIDTH * HEIGHT: more than 2147483647 points");
        num_points_ *= height;
    }
    if (promised_ && *promised_ != num_points_)
        throw malformed({file_, points_line_, "POINTS"},
                        "is not WIDTH * HEIGHT (got " + std::to_string(*promised_) +
                            ", need " + std::to_string(num_points_) + ")");
    if (num_points_ > kMaxSamples)
        throw malformed({file_, points_line_, "POINTS"}, "more than 2147483647 points");
    if (num_points_ == 0)
        throw malformed({file_, points_line_, "header"}, "no vertices (no points)");
    // A last line of text may lack its line end: one byte of grace.
    const std::uint64_t min_bytes = encoding_ == Encoding::Text     ? 2 * num_tokens_
                                    : encoding_ == Encoding::Binary ? point_bytes_
                                                                    : 0;
    if (min_bytes > 0 && num_points_ > (file_bytes_ + 1) / min_bytes)
        throw malformed({file_, points_line_, "POINTS"},
                        "the file is too short for its count (got " +
                            std::to_string(num_points_) + " points in " +
                            std::to_string(file_bytes_) + " bytes)");
}

void PcdScanner::assign_roles(Geometry& out)
{
    bool found[7] = {};
    for (Field& field : fields_)
    {
        const auto role = std::find(std::begin(kRoles), std::end(kRoles), field.name);
        field.role = static_cast<int>(role - std::begin(kRoles));
        if (role == std::end(kRoles))
            field.role = (field.name == "rgb" || field.name == "rgba") &&
                                 field.size == 4 && field.count == 1 && !found[6]
                             ? 6
                             : -1;
        if (field.role < 0)
            continue;
        if (found[field.role])
            throw malformed({file_, fields_line_, "FIELDS"},
                            in_quotes(field.name) + " stands twice");
        if (field.role < 6 && (field.count != 1 || !field.type()))
        {
            if (field.role < 3)
                throw malformed({file_, fields_line_, "FIELDS"},
                                in_quotes(field.name) +
                                    " needs a COUNT of 1 and a type that holds "
                                    "coordinates (F 4 or 8, I or U 1, 2 or 4)");
            field.role = -1;
            continue;
        }
        found[field.role] = true;
    }
    if (!found[0] || !found[1] || !found[2])
        throw malformed({file_, fields_line_, "FIELDS"}, "has no x, y or z");
    has_normals_ = found[3] && found[4] && found[5];
    has_colours_ = found[6];
    for (Field& field : fields_)
    {
        if (field.role >= 3 && field.role < 6 && !has_normals_)
            field.role = -1;
        if (field.role < 0)
        {
            if (field.name != "_")
                out.attributes.push_back(field.name);
            continue;
        }
        const Scalar stored = encoding_ != Encoding::Text ? field.type().value()
                              : field.kind == 'F'         ? Scalar::Text
                                                          : Scalar::TextInt;
        const std::size_t k = static_cast<std::size_t>(field.role % 3);
        if (field.role < 3)
            out.sample_places.scalars[k] = stored;
        else if (field.role < 6)
            out.direction_places.scalars[k] = stored;
    }
    if (has_normals_)
        out.attributes.push_back("normals");
    if (has_colours_)
        out.attributes.push_back("colours");
}

void PcdScanner::keep(const Point& point, Geometry& out)
{
    const double* v = point.values;
    if (std::isnan(v[0]) && std::isnan(v[1]) && std::isnan(v[2]))
    {
        ++out.num_missing;
        return;
    }
    for (int k = 0; k < 3; ++k)
        if (!std::isfinite(v[k]))
            throw malformed(here(point.numbers[k].start, std::string(kRoles[k])),
                            "is not finite (got " + shortest(v[k]) + ")");
    out.samples.emplace_back(v[0], v[1], v[2]);
    const bool is_text = encoding_ == Encoding::Text;
    if (is_text)
        out.sample_places.add(point.numbers);
    else
        out.sample_places.records.add(point_);
    if (has_colours_)
        out.colours.push_back({static_cast<std::uint8_t>(point.colour >> 16),
                               static_cast<std::uint8_t>(point.colour >> 8),
                               static_cast<std::uint8_t>(point.colour)});
    if (!has_normals_)
        return;
    // A normal that is none stays as it is: it takes no part.
    const Eigen::Vector3d normal(v[3], v[4], v[5]);
    if (!normal.allFinite() || normal.isZero(0))
    {
        out.num_bad_normals += normal.allFinite() ? 0 : 1;
        return;
    }
    out.directions.push_back(normal);
    out.direction_samples.push_back(static_cast<std::uint32_t>(out.samples.size() - 1));
    if (is_text)
        out.direction_places.add(point.numbers + 3);
    else
        out.direction_places.records.add(point_);
}

void PcdScanner::set_layout(std::uint64_t start, Geometry& out) const
{
    RecordPlaces::Layout samples, directions;
    for (const Field& field : fields_)
    {
        if (field.role < 0 || field.role >= 6)
            continue;
        const bool is_packed = encoding_ == Encoding::Compressed;
        const std::size_t k = static_cast<std::size_t>(field.role % 3);
        RecordPlaces::Layout& layout = field.role < 3 ? samples : directions;
        layout.first[k] = start + field.offset * (is_packed ? num_points_ : 1);
        layout.stride[k] = is_packed ? field.size : point_bytes_;
    }
    out.sample_places.records.set_layout(samples);
    out.direction_places.records.set_layout(directions);
}

void PcdScanner::text_point(std::string_view line, std::uint64_t start, Geometry& out)
{
    Tokens tokens(line, start);
    Token token;
    Point point;
    for (const Field& field : fields_)
        for (std::uint64_t i = 0; i < field.count; ++i)
        {
            if (!tokens.next(token))
                throw malformed(here(start, field.name), "is missing");
            const std::optional<double> value = parse_double(token.text);
            if (!value)
                throw malformed(here(start, field.name),
                                "is no number (got " + in_quotes(token.text) + ")");
            if (field.role == 6)
                point.colour = as_colour(*value, field.kind);
            else if (field.role >= 0)
            {
                if (field.kind != 'F' && !fits_stored(field.type().value(), *value))
                    throw malformed(here(start, field.name),
                                    "does not fit its type (got " +
                                        in_quotes(token.text) + ")");
                point.values[field.role] = *value;
                point.numbers[field.role] = token;
            }
        }
    if (tokens.next(token))
        throw malformed(here(start), "has more values than fields (got " +
                                         in_quotes(token.text) + ")");
    keep(point, out);
}

void PcdScanner::load(const char* bytes, std::uint64_t start, int role, Scalar type,
                      Point& point)
{
    if (role == 6)
    {
        std::uint32_t packed;
        std::memcpy(&packed, bytes, sizeof packed);
        point.colour = packed & 0xffffffu;
        return;
    }
    point.values[role] = load_stored(bytes, type, false);
    point.numbers[role].start = start;
}

void PcdScanner::binary_point(std::string_view bytes, std::uint64_t start, Geometry& out)
{
    Point point;
    for (const Field& field : fields_)
    {
        if (field.role < 0)
            continue;
        const std::uint64_t offset =
            encoding_ == Encoding::Binary
                ? field.offset
                : field.offset * num_points_ + point_ * field.size;
        load(bytes.data() + offset, start + offset, field.role,
             field.type().value_or(Scalar::UInt32), point);
    }
    keep(point, out);
}

std::vector<PcdScanner::Column> PcdScanner::columns() const
{
    std::vector<Column> columns;
    for (const Field& field : fields_)
        if (field.role >= 0)
            columns.push_back({field.offset * num_points_, field.size, field.role});
    return columns;
}

void PcdScanner::scan_columns(std::uint64_t first, std::uint64_t count,
                              const std::vector<std::string>& numbers, Geometry& out)
{
    set_layout(0, out);
    for (point_ = first; point_ < first + count; ++point_)
    {
        Point point;
        std::size_t column = 0;
        for (const Field& field : fields_)
        {
            if (field.role < 0)
                continue;
            load(numbers[column++].data() + (point_ - first) * field.size,
                 field.offset * num_points_ + point_ * field.size, field.role,
                 field.type().value_or(Scalar::UInt32), point);
        }
        keep(point, out);
    }
}

void PcdScanner::end_columns(std::uint64_t trailing)
{
    point_ = num_points_;
    trailing_ = trailing;
}

PcdScanner::PackedSizes PcdScanner::packed_sizes(std::string_view part,
                                                 std::uint64_t start) const
{
    if (part.size() < kPackedSizesBytes)
        throw malformed({file_, 0, "byte " + std::to_string(start)},
                        "the file ends here (need the sizes of the packed data)");
    PackedSizes sizes;
    std::memcpy(&sizes.packed, part.data(), 4);
    std::memcpy(&sizes.unpacked, part.data() + 4, 4);
    const std::uint64_t packed = sizes.packed, size = sizes.unpacked;
    const Where where{file_, 0, "sizes (byte " + std::to_string(start) + ")"};
    if (num_points_ > size / point_bytes_ || size != num_points_ * point_bytes_)
        throw malformed(where, "got " + std::to_string(size) + " bytes, need " +
                                   std::to_string(num_points_) + " points of " +
                                   std::to_string(point_bytes_) + " bytes");
    if (size / kMaxLzfRatio > packed)
        throw malformed(where, "got " + std::to_string(packed) +
                                   " packed bytes, too few for " + std::to_string(size));
    if (packed > file_bytes_ - start - kPackedSizesBytes)
        throw malformed(where, "the file is too short for its packed data (got " +
                                   std::to_string(packed) + " bytes)");
    return sizes;
}

std::size_t PcdScanner::unpack(std::string_view part, std::uint64_t start, bool is_last,
                               Geometry& out)
{
    // It would have to be in memory whole, or be read twice.
    if (file_bytes_ == kUnknownBytes)
        throw Error(Fault::Usage,
                    at({file_, 0, ""}, "a compressed PCD is unpacked into a temporary "
                                       "file (need a file, not stdin)"));
    if (part.size() < kPackedSizesBytes && !is_last)
        return 0;
    const PackedSizes sizes = packed_sizes(part, start);
    if (part.size() - kPackedSizesBytes < sizes.packed)
        return 0;
    std::optional<std::string> body =
        lzf_unpacked(part.substr(kPackedSizesBytes, sizes.packed), sizes.unpacked);
    if (!body)
        throw malformed({file_, 0, "byte " + std::to_string(start + kPackedSizesBytes)},
                        "the packed data cannot be unpacked");
    out.unpacked = std::move(*body);
    out.packed_start = start;
    set_layout(0, out);
    for (; point_ < num_points_; ++point_)
        binary_point(out.unpacked, 0, out);
    return kPackedSizesBytes + sizes.packed;
}

std::size_t PcdScanner::read_header(std::string_view part, Geometry& out)
{
    const std::size_t length = header(part);
    check_header();
    assign_roles(out);
    has_header_ = true;
    return length;
}

std::size_t PcdScanner::skip(std::string_view part)
{
    if (!has_header_ || point_ == num_points_ || encoding_ == Encoding::Compressed)
        return 0;
    if (encoding_ == Encoding::Binary)
    {
        const std::uint64_t count =
            std::min<std::uint64_t>(num_points_ - point_, part.size() / point_bytes_);
        point_ += count;
        return static_cast<std::size_t>(count * point_bytes_);
    }
    // One point a line; blank lines are none.
    const std::string_view whole = part.substr(0, part.rfind('\n') + 1);
    LineReader lines(whole, 0, true, lines_);
    for (std::string_view line; point_ < num_points_ && lines.next(line);)
        point_ += !Tokens(line, 0).rest().empty();
    lines_ = lines.line_number();
    return lines.consumed();
}

std::size_t PcdScanner::scan(std::string_view part, std::uint64_t start, bool is_last,
                             Geometry& out)
{
    std::size_t done = 0;
    last_byte_ = start + part.size();
    if (!has_header_)
    {
        if (!is_last && is_pcd_header_open(part))
            return 0;
        done = read_header(part, out);
    }
    if (encoding_ == Encoding::Text)
    {
        LineReader lines(part.substr(done), start + done, is_last, lines_);
        for (std::string_view line; lines.next(line);)
        {
            lines_ = lines.line_number();
            if (line.find('\0') != std::string_view::npos)
                throw malformed({file_, lines_, ""}, "holds binary data (a NUL byte)");
            if (Tokens(line, 0).rest().empty())
                continue;
            if (point_ == num_points_)
            {
                trailing_ += line.size();
                continue;
            }
            text_point(line, lines.line_start(), out);
            ++point_;
        }
        return done + lines.consumed();
    }
    if (encoding_ == Encoding::Compressed && point_ < num_points_)
    {
        const std::size_t used = unpack(part.substr(done), start + done, is_last, out);
        if (used == 0)
            return done;
        done += used;
    }
    if (encoding_ == Encoding::Binary)
        set_layout(start + done - point_ * point_bytes_, out);
    for (; point_ < num_points_ && part.size() - done >= point_bytes_; ++point_)
    {
        binary_point(part.substr(done), start + done, out);
        done += static_cast<std::size_t>(point_bytes_);
    }
    if (point_ < num_points_)
        return done;
    trailing_ += part.size() - done;
    return part.size();
}

void PcdScanner::finish(Geometry& out)
{
    if (point_ < num_points_)
        throw malformed(here(std::min(file_bytes_, last_byte_)),
                        "the file ends here (need " + std::to_string(num_points_) +
                            " points)");
    if (out.num_samples() == 0)
        throw malformed({file_, 0, ""}, "no vertices: every point is NaN");
    const auto warn = [&](std::uint64_t count, const char* what)
    {
        if (count > 0)
            out.warnings.push_back(at({file_, 0, ""}, std::to_string(count) + what));
    };
    warn(out.num_missing, " points without a place (NaN) stay as they are");
    warn(out.num_bad_normals, " normals are not finite and stay as they are");
    warn(trailing_, " bytes after the last point pass through");
}

bool is_packed_pcd(const InputFile& file)
{
    std::string head(
        static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), kMaxHeaderBytes)),
        '\0');
    file.read_at(0, head.data(), head.size());
    LineReader lines(head, 0, true);
    for (std::string_view line; lines.next(line);)
    {
        Tokens tokens(line, 0);
        Token word;
        if (tokens.next(word) && word.text == "DATA")
            return tokens.next(word) && word.text == "binary_compressed";
    }
    return false;
}

Error too_large_to_pack(const std::string& path)
{
    return malformed({path, 0, ""}, "is too large to be compressed");
}

std::string patched_pcd(const GeometryFile& file, const DeformedSamples& patch)
{
    const Geometry& geometry = file.geometry;
    std::string body = geometry.unpacked;
    overwrite_changed(geometry.sample_places, numbers_of(geometry.samples),
                      numbers_of(patch.samples), file.path, body);
    overwrite_changed(geometry.direction_places, numbers_of(geometry.directions),
                      numbers_of(patch.directions), file.path, body);
    if (body == geometry.unpacked)
        return file.bytes;
    std::string packed;
    for (std::size_t first = 0; first < body.size(); first += kPackedBlockBytes)
        packed += *lzf_packed(std::string_view(body).substr(first, kPackedBlockBytes));
    const std::size_t start = static_cast<std::size_t>(geometry.packed_start);
    std::uint32_t old_size;
    std::memcpy(&old_size, file.bytes.data() + start, sizeof old_size);
    if (packed.size() > 0xffffffffu)
        throw too_large_to_pack(file.path);
    std::string out = file.bytes.substr(0, start);
    store(static_cast<double>(packed.size()), Scalar::UInt32, false, out);
    store(static_cast<double>(body.size()), Scalar::UInt32, false, out);
    out += packed;
    out += std::string_view(file.bytes).substr(start + kPackedSizesBytes + old_size);
    return out;
}

} // namespace cellwarp::core
