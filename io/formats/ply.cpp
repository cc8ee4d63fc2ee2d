// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/ply.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>

#include "io/base/error.h"
#include "io/base/file_limits.h"
#include "io/base/large_pages.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kMaxProperties = 1024;

std::optional<Scalar> scalar_named(std::string_view name)
{
    if (name == "char" || name == "int8")
        return Scalar::Int8;
    if (name == "uchar" || name == "uint8")
        return Scalar::UInt8;
    if (name == "short" || name == "int16")
        return Scalar::Int16;
    if (name == "ushort" || name == "uint16")
        return Scalar::UInt16;
    if (name == "int" || name == "int32")
        return Scalar::Int32;
    if (name == "uint" || name == "uint32")
        return Scalar::UInt32;
    if (name == "float" || name == "float32")
        return Scalar::Float32;
    if (name == "double" || name == "float64")
        return Scalar::Float64;
    return std::nullopt;
}

/// The file's own line end: in a binary file the first data byte may be LF.
std::string_view line_end_of(std::string_view header)
{
    const std::size_t first = header.find_first_of("\r\n");
    if (first == std::string_view::npos || header[first] == '\n')
        return "\n";
    return header.substr(first).starts_with("\r\n") ? "\r\n" : "\r";
}

/// Whether more of the file could change how its header reads.
bool is_ply_header_open(std::string_view part)
{
    const std::string_view text =
        part.substr(byte_order_mark(part)).substr(0, kMaxHeaderBytes);
    const std::size_t first = text.find_first_of("\r\n");
    if (text.size() == kMaxHeaderBytes)
        return false;
    if (first == std::string_view::npos || first + 1 == text.size())
        return true;
    const std::string_view line_end = line_end_of(text);
    for (std::size_t next = 0;;)
    {
        const std::size_t end = text.find(line_end, next);
        if (end == std::string_view::npos)
            return true;
        std::string_view line = text.substr(next, end - next);
        while (!line.empty() && (is_blank(line.back()) || line.back() == '\r'))
            line.remove_suffix(1);
        if (line == "end_header")
            return false;
        next = end + line_end.size();
    }
}

bool is_real(Scalar type)
{
    return type == Scalar::Float32 || type == Scalar::Float64;
}

} // namespace

Where PlyScanner::here(std::uint64_t start, const std::string& field) const
{
    std::string place = elements_[element_].name + " " + std::to_string(record_);
    if (encoding_ != Encoding::Ascii)
        place += " (byte " + std::to_string(start) + ")";
    if (!field.empty())
        place += ": " + field;
    return {file_, encoding_ == Encoding::Ascii ? lines_ : 0, place};
}

int PlyScanner::role_of_list(const std::string& element, const Property& property)
{
    if (!property.is_list ||
        (property.name != "vertex_indices" && property.name != "vertex_index"))
        return -1;
    return element == "face" ? kCornerList : element == "tristrips" ? kStripList : -1;
}

void PlyScanner::header_line(std::string_view line)
{
    const Where where{file_, lines_, "header"};
    Tokens tokens(line, 0);
    Token word;
    if (!tokens.next(word) || word.text == "comment" || word.text == "obj_info")
        return;
    std::vector<std::string_view> words;
    for (Token token; tokens.next(token);)
        words.push_back(token.text);
    if (word.text == "format")
    {
        if (has_format_ || words.size() != 2 || words[1] != "1.0")
            throw malformed(where, "format is wrong (got " + in_quotes(line) +
                                       ", need one 'format ENCODING 1.0')");
        if (words[0] == "ascii")
            encoding_ = Encoding::Ascii;
        else if (words[0] == "binary_little_endian")
            encoding_ = Encoding::Little;
        else if (words[0] == "binary_big_endian")
            encoding_ = Encoding::Big;
        else
            throw malformed(where, "format is unknown (got " + in_quotes(words[0]) +
                                       ", need ascii, binary_little_endian or "
                                       "binary_big_endian)");
        has_format_ = true;
    }
    else if (word.text == "element")
    {
        const std::optional<std::int64_t> count =
            words.size() == 2 ? parse_integer(words[1]) : std::nullopt;
        if (!count || *count < 0)
            throw malformed(where, "element count is wrong (got " + in_quotes(line) +
                                       ", need 'element NAME COUNT' with COUNT >= 0)");
        const auto same = [&](const Element& e) { return e.name == words[0]; };
        if (std::any_of(elements_.begin(), elements_.end(), same))
            throw malformed(where, "element " + in_quotes(words[0]) + " stands twice");
        elements_.push_back(
            {std::string(words[0]), static_cast<std::uint64_t>(*count), lines_, {}, 0});
    }
    else if (word.text == "property")
    {
        if (elements_.empty())
            throw malformed(where, "property before any element");
        std::vector<Property>& properties = elements_.back().properties;
        Property property;
        property.is_list = !words.empty() && words[0] == "list";
        if (words.size() != (property.is_list ? 4u : 2u))
            throw malformed(where, "property is wrong (got " + in_quotes(line) +
                                       ", need 'property TYPE NAME' or 'property list "
                                       "COUNT_TYPE TYPE NAME')");
        const std::optional<Scalar> type = scalar_named(words[property.is_list ? 2 : 0]);
        const std::optional<Scalar> count =
            property.is_list ? scalar_named(words[1]) : Scalar::UInt8;
        if (!type || !count)
            throw malformed(where,
                            "property type is unknown (got " + in_quotes(line) + ")");
        if (is_real(*count))
            throw malformed(where, "a list's count must be an integer (got " +
                                       in_quotes(words[1]) + ")");
        property.type = *type;
        property.count_type = *count;
        property.name = words.back();
        const auto same = [&](const Property& p) { return p.name == property.name; };
        if (std::any_of(properties.begin(), properties.end(), same))
            throw malformed(where,
                            "property " + in_quotes(property.name) + " stands twice");
        if (properties.size() == kMaxProperties)
            throw malformed(where, "more than 1024 properties in one element");
        if (role_of_list(elements_.back().name, property) >= 0 && is_real(property.type))
            throw malformed(where, "the indices of faces must be integers (got " +
                                       in_quotes(words[2]) + ")");
        properties.push_back(property);
    }
    else
        throw malformed(where,
                        "this is no PLY header line (got " + in_quotes(line) + ")");
}

std::size_t PlyScanner::header(std::string_view part)
{
    const std::size_t mark = byte_order_mark(part);
    const std::string_view text = part.substr(mark, kMaxHeaderBytes);
    const std::string_view line_end = line_end_of(text);
    std::size_t next = 0;
    for (;;)
    {
        const std::size_t end = text.find(line_end, next);
        const bool is_ended = end != std::string_view::npos;
        std::string_view line = text.substr(next, is_ended ? end - next : end);
        ++lines_;
        if (!line.empty() && line.back() == '\r')
            line.remove_suffix(1);
        while (!line.empty() && is_blank(line.back()))
            line.remove_suffix(1);
        if (lines_ == 1 && line != "ply")
            throw malformed({file_, 1, ""}, part.empty()
                                                ? "the file is empty"
                                                : "is no PLY file (got " +
                                                      in_quotes(line) + ", need 'ply')");
        if (!is_ended && line != "end_header")
            throw malformed({file_, lines_, "header"}, text.size() == kMaxHeaderBytes
                                                           ? "is longer than 1 MB"
                                                           : "ends before end_header");
        next = is_ended ? end + line_end.size() : text.size();
        if (line == "end_header")
            break;
        if (lines_ > 1)
            header_line(line);
    }
    if (!has_format_)
        throw malformed({file_, 0, "header"}, "no format line");
    return mark + next;
}

void PlyScanner::assign_roles(Geometry& out)
{
    static constexpr std::string_view names[kCornerList] = {
        "x",     "y",     "z",     "nx",  "ny",    "nz",  "rot_0",
        "rot_1", "rot_2", "rot_3", "red", "green", "blue"};
    bool has_vertex = false;
    for (Element& element : elements_)
    {
        bool found[kCornerList] = {};
        for (Property& property : element.properties)
        {
            const std::size_t offset = static_cast<std::size_t>(element.min_bytes);
            element.min_bytes +=
                stored_size(property.is_list ? property.count_type : property.type);
            element.has_lists |= property.is_list;
            if (element.name == "vertex" && !property.is_list)
                for (int role = 0; role < kCornerList; ++role)
                    if (property.name == names[role])
                    {
                        property.role = role;
                        found[role] = true;
                        columns_[static_cast<std::size_t>(role)] = {offset,
                                                                    property.type};
                    }
            if (const int role = role_of_list(element.name, property); role >= 0)
            {
                property.role = role;
                has_faces_ |= element.count > 0;
            }
        }
        if (encoding_ == Encoding::Ascii)
            element.min_bytes = 2 * element.properties.size();
        const Where where{file_, element.line, "element " + element.name};
        // A last ascii line may lack its line end: one byte of grace.
        if (element.min_bytes > 0 &&
            element.count > (file_bytes_ + 1) / element.min_bytes)
            throw malformed(where, "the file is too short for its count (got " +
                                       std::to_string(element.count) + " records in " +
                                       std::to_string(file_bytes_) + " bytes)");
        if (element.name != "vertex")
            continue;
        has_vertex = true;
        num_samples_ = element.count;
        if (!found[0] || !found[1] || !found[2])
            throw malformed(where, "has no property x, y or z");
        if (element.count == 0)
            throw malformed(where, "no vertices");
        if (element.count > kMaxSamples)
            throw malformed(where, "more than 2147483647 vertices");
        const auto has = [&](int first, int end)
        { return std::all_of(found + first, found + end, [](bool is) { return is; }); };
        const auto is_stored_real = [&](const Property& property)
        {
            return property.role < kRotation || property.role >= kColour ||
                   is_real(property.type);
        };
        const bool has_normals = has(kNormal, kRotation);
        const bool has_rotations = has(kRotation, kColour) &&
                                   std::all_of(element.properties.begin(),
                                               element.properties.end(), is_stored_real);
        const bool has_colours = has(kColour, kCornerList);
        for (Property& property : element.properties)
        {
            const bool is_ascii = encoding_ == Encoding::Ascii;
            const Scalar stored = !is_ascii                ? property.type
                                  : is_real(property.type) ? Scalar::Text
                                                           : Scalar::TextInt;
            const bool is_normal = property.role >= kNormal && property.role < kRotation,
                       is_rotation =
                           property.role >= kRotation && property.role < kColour,
                       is_colour =
                           property.role >= kColour && property.role < kCornerList;
            if ((is_normal && !has_normals) || (is_rotation && !has_rotations) ||
                (is_colour && (!has_colours || property.type != Scalar::UInt8)))
                property.role = -1;
            element.has_normal |= property.role == kNormal;
            element.has_rotation |= property.role == kRotation;
            element.has_colour |= property.role == kColour;
            const std::size_t role = static_cast<std::size_t>(property.role);
            if (property.role < 0)
                out.attributes.push_back(property.name);
            else if (is_normal)
                out.direction_places.scalars[role - kNormal] = stored;
            else if (is_rotation)
                out.rotation_places.scalars[role - kRotation] = stored;
            else if (!is_colour)
                out.sample_places.scalars[role] = stored;
        }
        out.sample_places.big_endian = encoding_ == Encoding::Big;
        out.direction_places.big_endian = encoding_ == Encoding::Big;
        out.rotation_places.big_endian = encoding_ == Encoding::Big;
        if (has_rotations)
            out.attributes.push_back("rotations");
        if (has_normals)
            out.attributes.push_back("normals");
        if (has_colours)
            out.attributes.push_back("colours");
    }
    if (!has_vertex)
        throw malformed({file_, 0, "header"}, "no vertices (no element vertex)");
    for (const Element& element : elements_)
        if (element.name != "vertex" && element.name != "face" &&
            element.name != "tristrips")
            out.attributes.push_back("element " + element.name);
}

void PlyScanner::check_face(std::uint64_t count, std::uint64_t start) const
{
    if (count > kMaxCorners)
        throw malformed(here(start),
                        "got " + std::to_string(count) + " corners, need 0 to 1000000");
}

std::uint32_t PlyScanner::corner(double index, std::uint64_t start) const
{
    if (!(index >= 0 && index < static_cast<double>(num_samples_)) ||
        index != std::floor(index))
        throw malformed(here(start, "vertex index"),
                        "is out of range (got " + shortest(index) + ", need 0 to " +
                            std::to_string(num_samples_ - 1) + ")");
    return static_cast<std::uint32_t>(index);
}

void PlyScanner::add_to_strip(double index, std::uint64_t start, Strip& strip,
                              Geometry& out) const
{
    if (index == -1.0)
    {
        strip = {};
        return;
    }
    const std::uint32_t c = corner(index, start);
    const auto [a, b] = strip.last;
    // Corners that come twice lead from one strip to the next.
    if (strip.length >= 2 && a != b && b != c && c != a)
    {
        const bool is_odd = strip.length % 2 == 1;
        out.corners.insert(out.corners.end(), {is_odd ? b : a, is_odd ? a : b, c});
        out.face_ends.push_back(out.corners.size());
    }
    strip.last[0] = b;
    strip.last[1] = c;
    ++strip.length;
}

void PlyScanner::add_corner(int role, double index, std::uint64_t start, Strip& strip,
                            Geometry& out) const
{
    if (role == kCornerList)
        out.corners.push_back(corner(index, start));
    if (role == kShortList)
        corner(index, start); // no face, but its indices have to be right
    if (role == kStripList)
        add_to_strip(index, start, strip, out);
}

bool PlyScanner::keep_sample(const double* x, const std::uint64_t* starts,
                             Geometry& out) const
{
    if (!has_faces_ && std::isnan(x[0]) && std::isnan(x[1]) && std::isnan(x[2]))
    {
        ++out.num_missing;
        return false;
    }
    for (int k = 0; k < 3; ++k)
        if (!std::isfinite(x[k]))
            throw malformed(here(starts[k], std::string(1, "xyz"[k])),
                            "is not finite (got " + shortest(x[k]) + ")");
    out.samples.emplace_back(x[0], x[1], x[2]);
    return true;
}

bool PlyScanner::keep_normal(const double* n, Geometry& out)
{
    // A normal that is none stays as it is: it takes no part.
    const Eigen::Vector3d normal(n[0], n[1], n[2]);
    if (!normal.allFinite() || normal.isZero(0))
    {
        out.num_bad_normals += normal.allFinite() ? 0 : 1;
        return false;
    }
    out.directions.push_back(normal);
    out.direction_samples.push_back(static_cast<std::uint32_t>(out.samples.size() - 1));
    return true;
}

bool PlyScanner::keep_rotation(const double* q, Geometry& out)
{
    const Eigen::Vector4d rotation(q[0], q[1], q[2], q[3]);
    if (!rotation.allFinite() || rotation.isZero(0))
    {
        ++out.num_bad_rotations;
        return false;
    }
    out.rotations.push_back(rotation);
    out.rotation_samples.push_back(static_cast<std::uint32_t>(out.samples.size() - 1));
    return true;
}

void PlyScanner::keep(const Element& element, const Record& record, Geometry& out)
{
    const double* v = record.values;
    const std::uint64_t starts[3] = {record.numbers[0].start, record.numbers[1].start,
                                     record.numbers[2].start};
    if (!keep_sample(v, starts, out))
        return;
    out.sample_places.add(record.numbers);
    if (element.has_colour)
        out.colours.push_back({static_cast<std::uint8_t>(v[kColour]),
                               static_cast<std::uint8_t>(v[kColour + 1]),
                               static_cast<std::uint8_t>(v[kColour + 2])});
    if (element.has_rotation && keep_rotation(v + kRotation, out))
        out.rotation_places.add(record.numbers + kRotation);
    if (element.has_normal && keep_normal(v + kNormal, out))
        out.direction_places.add(record.numbers + kNormal);
}

void PlyScanner::keep_fixed(const Element& element, std::string_view records,
                            std::uint64_t start, Geometry& out)
{
    const std::size_t size = static_cast<std::size_t>(element.min_bytes);
    const bool big = encoding_ == Encoding::Big;
    const std::size_t count = records.size() / size;
    const std::uint64_t first = start - record_ * size; // of vertex 0
    const auto layout_of = [&](int role, std::size_t length)
    {
        RecordPlaces::Layout layout;
        for (std::size_t k = 0; k < length; ++k)
        {
            layout.first[k] = first + columns_[static_cast<std::size_t>(role) + k].offset;
            layout.stride[k] = size;
        }
        return layout;
    };
    out.sample_places.records.set_layout(layout_of(0, 3));
    out.direction_places.records.set_layout(layout_of(kNormal, 3));
    out.rotation_places.records.set_layout(layout_of(kRotation, 4));
    reserve_large(out.samples, out.samples.size() + count);
    if (element.has_colour)
        reserve_large(out.colours, out.colours.size() + count);
    if (element.has_normal)
    {
        reserve_large(out.directions, out.directions.size() + count);
        reserve_large(out.direction_samples, out.direction_samples.size() + count);
    }
    if (element.has_rotation)
    {
        reserve_large(out.rotations, out.rotations.size() + count);
        reserve_large(out.rotation_samples, out.rotation_samples.size() + count);
    }
    // Column by column, a few at once, so that they stay in the cache.
    constexpr std::size_t kAtOnce = 512;
    std::array<double, 3 * kAtOnce> x, n;
    std::array<double, 4 * kAtOnce> q;
    for (std::size_t done = 0; done < count; done += kAtOnce)
    {
        const std::size_t num = std::min(kAtOnce, count - done);
        const char* const bytes = records.data() + done * size;
        const auto load = [&](int role, std::size_t length, double* values)
        {
            for (std::size_t k = 0; k < length; ++k)
            {
                const Column& column = columns_[static_cast<std::size_t>(role) + k];
                load_stored(bytes + column.offset, size, column.type, big, num,
                            values + k, length);
            }
        };
        load(0, 3, x.data());
        if (element.has_normal)
            load(kNormal, 3, n.data());
        if (element.has_rotation)
            load(kRotation, 4, q.data());
        for (std::size_t i = 0; i < num; ++i, ++record_)
        {
            const char* const record = bytes + i * size;
            const std::uint64_t at = first + record_ * size;
            const std::uint64_t starts[3] = {at + columns_[0].offset,
                                             at + columns_[1].offset,
                                             at + columns_[2].offset};
            if (!keep_sample(x.data() + 3 * i, starts, out))
                continue;
            out.sample_places.records.add(record_);
            if (element.has_colour)
                out.colours.push_back(
                    {static_cast<std::uint8_t>(record[columns_[kColour].offset]),
                     static_cast<std::uint8_t>(record[columns_[kColour + 1].offset]),
                     static_cast<std::uint8_t>(record[columns_[kColour + 2].offset])});
            if (element.has_rotation && keep_rotation(q.data() + 4 * i, out))
                out.rotation_places.records.add(record_);
            if (element.has_normal && keep_normal(n.data() + 3 * i, out))
                out.direction_places.records.add(record_);
        }
    }
}

std::size_t PlyScanner::keep_faces(const Element& element, std::string_view bytes,
                                   Geometry& out)
{
    const Property& list = element.properties.front();
    if (element.properties.size() != 1 || list.role != kCornerList ||
        stored_size(list.count_type) != 1 || stored_size(list.type) != 4)
        return 0;
    const bool big = encoding_ == Encoding::Big;
    const std::uint64_t most =
        std::min<std::uint64_t>(element.count - record_, bytes.size() / 13);
    if (record_ == 0) // a later exact size would copy them each time
    {
        out.face_ends.reserve(out.face_ends.size() + static_cast<std::size_t>(most));
        reserve_large(out.corners,
                      out.corners.size() + 3 * static_cast<std::size_t>(most));
    }
    std::size_t at = 0;
    for (; record_ < element.count && at < bytes.size(); ++record_)
    {
        // Faulty or incomplete records go to binary_record().
        const unsigned count = static_cast<unsigned char>(bytes[at]);
        if (count < 3 || (count > 127 && list.count_type == Scalar::Int8) ||
            bytes.size() - at - 1 < 4 * std::size_t(count))
            break;
        const std::size_t first = out.corners.size();
        bool is_right = true;
        for (unsigned k = 0; k < count; ++k)
        {
            std::uint32_t index;
            std::memcpy(&index, bytes.data() + at + 1 + 4 * std::size_t(k), 4);
            index = big ? __builtin_bswap32(index) : index;
            is_right &= index < num_samples_;
            out.corners.push_back(index);
        }
        if (!is_right)
        {
            out.corners.resize(first);
            break;
        }
        out.face_ends.push_back(out.corners.size());
        at += 1 + 4 * std::size_t(count);
    }
    return at;
}

bool PlyScanner::ascii_record(const Element& element, std::string_view line,
                              std::uint64_t start, Geometry& out)
{
    Tokens tokens(line, start);
    Token token;
    if (!element.properties.empty() && tokens.rest().empty())
        return false;
    Record record;
    const auto number = [&](const std::string& name)
    {
        if (!tokens.next(token))
            throw malformed(here(token.start, name), "is missing");
        const std::optional<double> value = parse_double(token.text);
        if (!value)
            throw malformed(here(token.start, name),
                            "is no number (got " + in_quotes(token.text) + ")");
        return *value;
    };
    for (const Property& property : element.properties)
    {
        const double value = number(property.name);
        if (!property.is_list)
        {
            if (!is_real(property.type) && !fits_stored(property.type, value))
                throw malformed(here(token.start, property.name),
                                "does not fit its type (got " + in_quotes(token.text) +
                                    ")");
            if (property.role >= 0)
                record.values[property.role] = value;
            if (property.role >= 0 && property.role < kColour)
                record.numbers[property.role] = token;
            continue;
        }
        if (!(value >= 0 && value <= 4294967295.0) || value != std::floor(value))
            throw malformed(here(token.start, property.name),
                            "is no list length (got " + in_quotes(token.text) + ")");
        const int role =
            property.role == kCornerList && value < 3 ? kShortList : property.role;
        if (role == kCornerList)
            check_face(static_cast<std::uint64_t>(value), token.start);
        Strip strip;
        for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(value); ++i)
        {
            const double item = number(property.name);
            add_corner(role, item, token.start, strip, out);
        }
        if (role == kCornerList)
            out.face_ends.push_back(out.corners.size());
    }
    if (tokens.next(token))
        throw malformed(here(token.start), "has more values than properties (got " +
                                               in_quotes(token.text) + ")");
    if (element.name == "vertex")
        keep(element, record, out);
    return true;
}

bool PlyScanner::binary_record(const Element& element, std::string_view bytes,
                               std::uint64_t start, std::size_t& length, Geometry& out)
{
    const bool big = encoding_ == Encoding::Big;
    Record record;
    std::size_t at = 0;
    for (const Property& property : element.properties)
    {
        const Scalar type = property.is_list ? property.count_type : property.type;
        if (bytes.size() - at < stored_size(type))
            return false;
        const double value = load_stored(bytes.data() + at, type, big);
        if (!property.is_list)
        {
            if (property.role >= 0)
                record.values[property.role] = value;
            if (property.role >= 0 && property.role < kColour)
                record.numbers[property.role].start = start + at;
            at += stored_size(type);
            continue;
        }
        if (value < 0)
            throw malformed(here(start + at, property.name),
                            "is no list length (got " + shortest(value) + ")");
        const std::uint64_t count = static_cast<std::uint64_t>(value);
        const int role =
            property.role == kCornerList && count < 3 ? kShortList : property.role;
        if (role == kCornerList)
            check_face(count, start + at);
        at += stored_size(type);
        const std::uint64_t size = count * stored_size(property.type);
        if (size > file_bytes_ - (start + at))
            throw malformed(here(start + at, property.name),
                            "the list is longer than the file (got " +
                                std::to_string(count) + " items)");
        if (bytes.size() - at < size)
            return false;
        Strip strip;
        for (std::uint64_t i = 0; role >= 0 && i < count; ++i)
            add_corner(role,
                       load_stored(bytes.data() + at + i * stored_size(property.type),
                                   property.type, big),
                       start + at, strip, out);
        if (role == kCornerList)
            out.face_ends.push_back(out.corners.size());
        at += static_cast<std::size_t>(size);
    }
    if (element.name == "vertex")
        keep(element, record, out);
    length = at;
    return true;
}

/// Moves on to the element of the next record; false after the last one.
bool PlyScanner::next_element()
{
    while (element_ < elements_.size() && (record_ == elements_[element_].count ||
                                           elements_[element_].properties.empty()))
    {
        ++element_;
        record_ = 0;
    }
    return element_ < elements_.size();
}

std::size_t PlyScanner::skip(std::string_view part)
{
    if (!has_header_ || !next_element())
        return 0;
    const Element& element = elements_[element_];
    if (encoding_ == Encoding::Ascii)
    {
        // One record a line; blank lines are none.
        const std::string_view whole = part.substr(0, part.rfind('\n') + 1);
        LineReader lines(whole, 0, true, lines_);
        for (std::string_view line; record_ < element.count && lines.next(line);)
            record_ += !Tokens(line, 0).rest().empty();
        lines_ = lines.line_number();
        return lines.consumed();
    }
    if (element.has_lists)
        return 0;
    const std::uint64_t count =
        std::min(element.count - record_, part.size() / element.min_bytes);
    record_ += count;
    return static_cast<std::size_t>(count * element.min_bytes);
}

std::size_t PlyScanner::scan(std::string_view part, std::uint64_t start, bool is_last,
                             Geometry& out)
{
    std::size_t done = 0;
    if (!has_header_)
    {
        if (!is_last && is_ply_header_open(part))
            return 0;
        done = header(part);
        assign_roles(out);
        has_header_ = true;
    }
    if (encoding_ == Encoding::Ascii)
    {
        LineReader lines(part.substr(done), start + done, is_last, lines_);
        std::string_view line;
        while (lines.next(line))
        {
            lines_ = lines.line_number();
            if (line.find('\0') != std::string_view::npos)
                throw malformed({file_, lines_, ""}, "holds binary data (a NUL byte)");
            if (next_element())
                record_ +=
                    ascii_record(elements_[element_], line, lines.line_start(), out);
            else
                trailing_ += Tokens(line, 0).rest().empty() ? 0 : line.size();
        }
        return done + lines.consumed();
    }
    while (next_element())
    {
        const Element& element = elements_[element_];
        if (!element.has_lists)
        {
            const std::uint64_t count = std::min<std::uint64_t>(
                element.count - record_, (part.size() - done) / element.min_bytes);
            const std::size_t length =
                static_cast<std::size_t>(count * element.min_bytes);
            if (count == 0)
                return done;
            if (element.name == "vertex")
                keep_fixed(element, part.substr(done, length), start + done, out);
            else
                record_ += count;
            done += length;
            continue;
        }
        done += keep_faces(element, part.substr(done), out);
        if (record_ == element.count)
            continue;
        std::size_t length = 0;
        const std::size_t corners = out.corners.size(), faces = out.face_ends.size();
        if (!binary_record(element, part.substr(done), start + done, length, out))
        {
            // Read again when there is more of it.
            out.corners.resize(corners);
            out.face_ends.truncate(faces);
            return done;
        }
        done += length;
        ++record_;
    }
    trailing_ += part.size() - done;
    return part.size();
}

std::optional<PlyScanner::Vertices> PlyScanner::find_vertices(std::string_view part,
                                                              Geometry& out)
{
    Vertices vertices;
    vertices.start = header(part);
    assign_roles(out);
    has_header_ = true;
    for (const Element& element : elements_)
    {
        if (encoding_ == Encoding::Ascii || (element.has_lists && element.count > 0))
            return std::nullopt;
        vertices.bytes = element.min_bytes;
        vertices.count = element.count;
        if (element.name == "vertex")
            break;
        vertices.start += element.count * element.min_bytes;
    }
    if (vertices.bytes == 0)
        return std::nullopt;
    if (vertices.start > file_bytes_ ||
        vertices.count > (file_bytes_ - vertices.start) / vertices.bytes)
        throw malformed({file_, 0, "element vertex"},
                        "the file ends in its vertices (got " +
                            std::to_string(file_bytes_) + " bytes)");
    return vertices;
}

void PlyScanner::seek_vertex(std::uint64_t i)
{
    element_ = 0;
    while (elements_[element_].name != "vertex")
        ++element_;
    record_ = i;
}

void PlyScanner::finish(Geometry& out)
{
    if (next_element())
    {
        const Element& element = elements_[element_];
        throw malformed({file_, encoding_ == Encoding::Ascii ? lines_ : 0,
                         element.name + " " + std::to_string(record_) +
                             (file_bytes_ == kUnknownBytes
                                  ? ""
                                  : " (byte " + std::to_string(file_bytes_) + ")")},
                        "the file ends here (need " + std::to_string(element.count) +
                            " records)");
    }
    if (out.num_samples() == 0)
        throw malformed({file_, 0, ""}, "no vertices: every point is NaN");
    if (out.num_missing > 0)
        out.warnings.push_back(
            at({file_, 0, ""}, std::to_string(out.num_missing) +
                                   " points without a place (NaN) stay as they are"));
    if (trailing_ > 0)
        out.warnings.push_back(at({file_, 0, ""}, std::to_string(trailing_) +
                                                      " bytes after the last record pass "
                                                      "through"));
    if (out.num_bad_normals > 0)
        out.warnings.push_back(
            at({file_, 0, ""}, std::to_string(out.num_bad_normals) +
                                   " normals are not finite and stay as "
                                   "they are"));
    if (out.num_bad_rotations > 0)
        out.warnings.push_back(at({file_, 0, ""}, std::to_string(out.num_bad_rotations) +
                                                      " rotations are zero or not finite "
                                                      "and stay as they are"));
}

} // namespace cellwarp::core
