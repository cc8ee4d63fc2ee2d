// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/stl.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include <Eigen/Geometry>

#include "io/base/large_pages.h"
#include "io/base/number.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

namespace
{

constexpr std::uint64_t kHeaderBytes = 84, kFacetBytes = 50;
constexpr std::uint64_t kMaxFacets = ((std::uint64_t(1) << 31) - 1) / 3;

bool is_comment(std::string_view word)
{
    return word.starts_with(';') || word.starts_with('#') || word.starts_with("//");
}

} // namespace

void StlScanner::begin(std::string_view part, Geometry& out)
{
    const bool has_count = part.size() >= kHeaderBytes;
    count_ = has_count ? static_cast<std::uint64_t>(
                             load_stored(part.data() + 80, Scalar::UInt32, false))
                       : 0;
    const std::uint64_t needed = kHeaderBytes + kFacetBytes * count_;
    const bool fits =
        has_count && (file_bytes_ == kUnknownBytes ||
                      (file_bytes_ >= needed && file_bytes_ - needed < kFacetBytes));
    const std::string_view text = part.substr(byte_order_mark(part));
    const std::size_t word = text.find_first_not_of(" \t\r\n");
    const bool says_solid =
        word != std::string_view::npos && lower_case(text.substr(word, 5)) == "solid";
    kind_ = says_solid && !(fits && count_ > 0 && part.find('\0') < part.size())
                ? Kind::Ascii
                : Kind::Binary;
    expected_ = "solid";
    if (kind_ == Kind::Ascii)
        return;
    if (!has_count)
        throw malformed({file_, 0, "header"},
                        "the file ends here (got " + std::to_string(file_bytes_) +
                            " bytes, need 84 or a text that starts with 'solid')");
    if (!fits)
        throw malformed({file_, 0, "count (byte 80)"},
                        "got " + std::to_string(count_) + " facets, need " +
                            std::to_string((file_bytes_ - kHeaderBytes) / kFacetBytes) +
                            " for the file's size");
    if (count_ == 0)
        throw malformed({file_, 0, "count (byte 80)"}, "no vertices (0 facets)");
    if (count_ > kMaxFacets)
        throw malformed({file_, 0, "count (byte 80)"}, "got " + std::to_string(count_) +
                                                           " facets, need at most " +
                                                           std::to_string(kMaxFacets));
    out.sample_places.scalars.fill(Scalar::Float32);
    out.direction_places.scalars.fill(Scalar::Float32);
}

bool StlScanner::add_normal(const Eigen::Vector3d& normal, Geometry& out)
{
    // A normal that is none stays as it is.
    if (!normal.allFinite() || normal.isZero(0))
    {
        out.num_bad_normals += normal.allFinite() ? 0 : 1;
        return false;
    }
    out.directions.push_back(normal);
    out.direction_samples.push_back(static_cast<std::uint32_t>(out.samples.size()));
    return true;
}

void StlScanner::facets(const char* records, std::size_t count, std::uint64_t start,
                        Geometry& out)
{
    const std::uint64_t first = start - facet_ * kFacetBytes;
    out.direction_places.records.set_layout(
        {{first, first + 4, first + 8}, {kFacetBytes, kFacetBytes, kFacetBytes}});
    out.sample_places.records.set_layout({{first + 12, first + 16, first + 20},
                                          {kFacetBytes, kFacetBytes, kFacetBytes},
                                          3,
                                          12});
    reserve_large(out.samples, out.samples.size() + 3 * count);
    reserve_large(out.corners, out.corners.size() + 3 * count);
    out.face_ends.reserve(out.face_ends.size() + count);
    reserve_large(out.directions, out.directions.size() + count);
    reserve_large(out.direction_samples, out.direction_samples.size() + count);
    for (std::size_t i = 0; i < count; ++i, records += kFacetBytes, ++facet_)
    {
        Eigen::Matrix<float, 3, 4> numbers; // the normal and three corners
        std::memcpy(numbers.data(), records, sizeof(float) * 12);
        if (add_normal(numbers.col(0).cast<double>(), out))
            out.direction_places.records.add(facet_);
        for (int corner = 1; corner < 4; ++corner)
        {
            if (!numbers.col(corner).allFinite())
                throw malformed(
                    {file_, 0,
                     "facet " + std::to_string(facet_) + " (byte " +
                         std::to_string(first + facet_ * kFacetBytes +
                                        12 * static_cast<std::uint64_t>(corner)) +
                         ")"},
                    "a corner is not finite");
            out.corners.push_back(static_cast<std::uint32_t>(out.samples.size()));
            out.samples.push_back(numbers.col(corner).cast<double>());
        }
        out.sample_places.records.add(3 * facet_, 3);
        out.face_ends.push_back(out.corners.size());
    }
}

void StlScanner::numbers(Tokens& tokens, bool is_normal, Geometry& out)
{
    const std::string field = is_normal ? "normal" : "vertex";
    Eigen::Vector3d v;
    Token token, numbers[3];
    for (int k = 0; k < 3; ++k)
    {
        if (!tokens.next(token))
            throw malformed({file_, lines_, field},
                            "got " + std::to_string(k) + " numbers, need 3");
        const std::optional<double> value = parse_double(token.text);
        if (!value)
            throw malformed({file_, lines_, field},
                            "is no number (got " + in_quotes(token.text) + ")");
        if (!is_normal && !std::isfinite(*value))
            throw malformed({file_, lines_, field},
                            "is not finite (got " + in_quotes(token.text) + ")");
        v[k] = *value;
        numbers[k] = token;
    }
    if (is_normal)
    {
        if (add_normal(v, out))
            out.direction_places.add(numbers);
        return;
    }
    out.corners.push_back(static_cast<std::uint32_t>(out.samples.size()));
    out.samples.push_back(v);
    out.sample_places.add(numbers);
}

void StlScanner::statement(std::string_view line, std::uint64_t start, Geometry& out)
{
    Tokens tokens(line, start);
    Token token;
    if (!tokens.next(token))
        return;
    std::string word = lower_case(token.text);
    const std::string_view first = token.text;
    // Colours of facets, and comments, are no part of the format; some programs write
    // them.
    const bool is_colour = word == "color" || word == "colour";
    if (is_comment(first) || (is_colour && expected_ != "solid"))
        return;
    if ((word == "facet" || word == "outer") && tokens.next(token))
        word += " " + lower_case(token.text);
    else if (word == "end" && tokens.next(token))
        word += lower_case(token.text);
    // Keywords of two words are joined by a blank; alternatives by a bar.
    const std::string allowed = "|" + expected_ + "|";
    if (allowed.find("|" + word + "|") == std::string::npos)
        throw malformed(
            {file_, lines_, ""},
            "got " +
                in_quotes(word == std::string(first) ? first : std::string_view(word)) +
                ", need " + expected_);
    if (word == "solid")
    {
        expected_ = "facet normal|endsolid";
        return; // the rest is its name
    }
    if (word == "endsolid")
    {
        expected_ = "solid";
        return;
    }
    if (word == "facet normal")
    {
        numbers(tokens, true, out);
        in_facet_ = true;
        expected_ = "outer loop";
        corners_ = 0;
    }
    else if (word == "outer loop")
        expected_ = "vertex";
    else if (word == "vertex")
    {
        numbers(tokens, false, out);
        expected_ = ++corners_ < 3 ? "vertex" : "endloop";
    }
    else if (word == "endloop")
        expected_ = "endfacet";
    else
    {
        out.face_ends.push_back(out.corners.size());
        in_facet_ = false;
        expected_ = "facet normal|endsolid";
    }
    if (tokens.next(token) && !is_comment(token.text))
        throw malformed({file_, lines_, word},
                        "one word too many (got " + in_quotes(token.text) + ")");
}

std::size_t StlScanner::scan(std::string_view part, std::uint64_t start, bool is_last,
                             Geometry& out)
{
    std::size_t done = 0;
    if (kind_ == Kind::Unknown)
    {
        if (!is_last && part.size() < kHeaderBytes)
            return 0;
        begin(part, out);
        done = kind_ == Kind::Binary ? kHeaderBytes : byte_order_mark(part);
    }
    if (kind_ == Kind::Ascii)
    {
        const std::size_t skipped = done;
        LineReader lines(part.substr(skipped), start + skipped, is_last, lines_);
        std::string_view line;
        // What was there before the facet that is being read.
        std::size_t samples = out.samples.size(), corners = out.corners.size(),
                    directions = out.directions.size(), bad_normals = out.num_bad_normals;
        std::int64_t lines_before = lines_;
        while (lines.next(line))
        {
            lines_ = lines.line_number();
            statement(line, lines.line_start(), out);
            if (in_facet_)
                continue;
            done = skipped + lines.consumed();
            samples = out.samples.size();
            corners = out.corners.size();
            directions = out.directions.size();
            bad_normals = out.num_bad_normals;
            lines_before = lines_;
        }
        if (in_facet_)
        {
            // Its normal follows from its corners: only whole facets are handed out.
            out.samples.resize(samples);
            out.sample_places.truncate(samples);
            out.corners.resize(corners);
            out.directions.resize(directions);
            out.direction_samples.resize(directions);
            out.direction_places.truncate(directions);
            out.num_bad_normals = bad_normals;
        }
        if (in_facet_ && !is_last)
        {
            // Read again when there is more of it.
            lines_ = lines_before;
            in_facet_ = false;
            expected_ = "facet normal|endsolid";
        }
        return done;
    }
    const std::size_t count = static_cast<std::size_t>(
        std::min<std::uint64_t>(count_ - facet_, (part.size() - done) / kFacetBytes));
    if (count > 0)
        facets(part.data() + done, count, start + done, out);
    done += count * kFacetBytes;
    if (facet_ < count_)
        return done;
    trailing_ += part.size() - done;
    if (trailing_ >= kFacetBytes)
        throw malformed({file_, 0, "count (byte 80)"},
                        "more data than its " + std::to_string(count_) + " facets");
    return part.size();
}

std::size_t StlScanner::skip(std::string_view part)
{
    if (kind_ != Kind::Binary)
        return 0;
    const std::uint64_t count =
        std::min<std::uint64_t>(count_ - facet_, part.size() / kFacetBytes);
    facet_ += count;
    return static_cast<std::size_t>(count * kFacetBytes);
}

void StlScanner::finish(Geometry& out)
{
    if (kind_ == Kind::Ascii && expected_ != "solid")
        throw malformed({file_, lines_, ""},
                        "the file ends before endsolid (need " + expected_ + ")");
    if (kind_ == Kind::Binary && facet_ < count_)
        throw malformed({file_, 0, "facet " + std::to_string(facet_)},
                        "the file ends here");
    if (out.num_samples() == 0)
        throw malformed({file_, 0, ""}, "no vertices");
    if (out.num_directions() > 0)
        out.attributes.push_back("normals");
    if (trailing_ > 0)
        out.warnings.push_back(
            at({file_, 0, ""},
               std::to_string(trailing_) + " bytes after the last facet pass through"));
    if (out.num_bad_normals > 0)
        out.warnings.push_back(
            at({file_, 0, ""}, std::to_string(out.num_bad_normals) +
                                   " normals are not finite and stay as "
                                   "they are"));
}

std::vector<Eigen::Vector3d> facet_normals(const Geometry& geometry,
                                           const std::vector<Eigen::Vector3d>& samples)
{
    std::vector<Eigen::Vector3d> normals = geometry.directions;
    for (std::size_t d = 0; d < normals.size(); ++d)
    {
        const std::size_t i = geometry.direction_samples[d];
        const std::vector<Eigen::Vector3d>& old = geometry.samples;
        if (samples[i] == old[i] && samples[i + 1] == old[i + 1] &&
            samples[i + 2] == old[i + 2])
            continue;
        const Eigen::Vector3d before = (old[i + 1] - old[i]).cross(old[i + 2] - old[i]);
        const Eigen::Vector3d after =
            (samples[i + 1] - samples[i]).cross(samples[i + 2] - samples[i]);
        const double length = after.stableNorm();
        if (length > 0)
            normals[d] = (before.dot(normals[d]) < 0 ? -1.0 : 1.0) * normals[d].norm() /
                         length * after;
    }
    return normals;
}

} // namespace cellwarp::core
