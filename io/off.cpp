// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/off.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "io/error.h"
#include "io/file_limits.h"
#include "io/number.h"

namespace cellwarp
{

namespace
{

} // namespace

Where OffScanner::here() const
{
    std::string field = expect_ == Expect::Vertices ? "vertex " + std::to_string(record_)
                        : expect_ == Expect::Faces  ? "face " + std::to_string(record_)
                                                    : "header";
    return {file_, lines_, field};
}

/// Moves on once the records of this kind are all there.
void OffScanner::advance()
{
    if (expect_ == Expect::Vertices && record_ == num_vertices_)
    {
        expect_ = Expect::Faces;
        record_ = 0;
    }
    if (expect_ == Expect::Faces && record_ == num_faces_)
        expect_ = Expect::End;
}

void OffScanner::magic(std::string_view& text, std::uint64_t& start)
{
    // Prefixes in the format's order: ST, C, N, 4, n; then OFF, perhaps glued to
    // the first count.
    const std::size_t off = text.find("OFF");
    const std::string_view prefix =
        text.substr(0, off == std::string_view::npos ? 0 : off);
    if (off == std::string_view::npos || off > 4)
        throw malformed(here(),
                        "is no OFF file (got " + in_quotes(text) + ", need 'OFF')");
    std::string_view rest = prefix;
    has_colours_ = rest.starts_with('C');
    rest.remove_prefix(has_colours_ ? 1 : 0);
    has_normals_ = rest.starts_with('N');
    rest.remove_prefix(has_normals_ ? 1 : 0);
    if (!rest.empty())
        throw malformed(here(), "this kind of OFF is not read (got " + in_quotes(text) +
                                    ", need OFF, COFF, NOFF or CNOFF)");
    text.remove_prefix(off + 3);
    start += off + 3;
    if (text.find("BINARY") != std::string_view::npos)
        throw malformed(here(), "binary OFF is not read (need the text form)");
    expect_ = Expect::Counts;
}

void OffScanner::counts(Tokens& tokens)
{
    std::int64_t values[3] = {0, 0, 0};
    int count = 0;
    for (Token token; tokens.next(token); ++count)
    {
        const std::optional<std::int64_t> value = parse_integer(token.text);
        if (!value || *value < 0 || count == 3)
            throw malformed(here(), "counts are wrong (got " + in_quotes(token.text) +
                                        ", need vertices, faces and edges)");
        values[count] = *value;
    }
    if (count == 0)
        return;
    if (count == 1)
        throw malformed(here(),
                        "counts are wrong (got one number, need vertices, faces and "
                        "edges)");
    // A vertex takes at least 6 bytes ("0 0 0\n"), a face 8.
    if (values[0] > kMaxSamples ||
        static_cast<std::uint64_t>(values[0]) > (file_bytes_ + 1) / 6)
        throw malformed(here(), "the file is too short for its vertices (got " +
                                    std::to_string(values[0]) + ")");
    if (static_cast<std::uint64_t>(values[1]) > (file_bytes_ + 1) / 8)
        throw malformed(here(), "the file is too short for its faces (got " +
                                    std::to_string(values[1]) + ")");
    if (values[0] == 0)
        throw malformed(here(), "no vertices");
    num_vertices_ = static_cast<std::uint64_t>(values[0]);
    num_faces_ = static_cast<std::uint64_t>(values[1]);
    expect_ = Expect::Vertices;
    advance();
}

bool OffScanner::vertex_token(const Token& token, Geometry& out)
{
    const std::optional<double> value = parse_double(token.text);
    if (!value)
        throw malformed(here(), "is no number (got " + in_quotes(token.text) + ")");
    if (!std::isfinite(*value))
        throw malformed(here(), "is not finite (got " + in_quotes(token.text) + ")");
    values_.push_back(*value);
    starts_.push_back(token.start);
    if (values_.size() < (has_normals_ ? 6u : 3u))
        return false;
    out.samples.emplace_back(values_[0], values_[1], values_[2]);
    out.sample_places.starts.append(starts_.begin(), starts_.begin() + 3);
    if (has_normals_ && Eigen::Vector3d(values_[3], values_[4], values_[5]).norm() > 0)
    {
        out.directions.emplace_back(values_[3], values_[4], values_[5]);
        out.direction_samples.push_back(
            static_cast<std::uint32_t>(out.samples.size() - 1));
        out.direction_places.starts.append(starts_.begin() + 3, starts_.end());
    }
    values_.clear();
    starts_.clear();
    ++record_;
    return has_colours_;
}

bool OffScanner::face_token(const Token& token, Geometry& out)
{
    const std::optional<std::int64_t> value = parse_integer(token.text);
    if (!value)
        throw malformed(here(), "is no index (got " + in_quotes(token.text) + ")");
    if (corners_left_ < 0)
    {
        if (*value < 3 || *value > kMaxCorners)
            throw malformed(here(), "got " + in_quotes(token.text) +
                                        " corners, need 3 to 1000000");
        corners_left_ = *value;
        return false;
    }
    if (*value < 0 || *value >= static_cast<std::int64_t>(num_vertices_))
        throw malformed(here(), "vertex index is out of range (got " +
                                    in_quotes(token.text) + ", need 0 to " +
                                    std::to_string(num_vertices_ - 1) + ")");
    out.corners.push_back(static_cast<std::uint32_t>(*value));
    if (--corners_left_ > 0)
        return false;
    corners_left_ = -1;
    out.face_ends.push_back(out.corners.size());
    ++record_;
    return true;
}

void OffScanner::line(std::string_view text, std::uint64_t start, Geometry& out)
{
    text = text.substr(0, text.find('#'));
    if (expect_ == Expect::Magic)
    {
        while (!text.empty() && is_blank(text.front()))
        {
            text.remove_prefix(1);
            ++start;
        }
        if (text.empty())
            return;
        magic(text, start);
    }
    Tokens tokens(text, start);
    if (expect_ == Expect::Counts)
    {
        counts(tokens);
        return;
    }
    for (Token token; tokens.next(token);)
    {
        if (expect_ == Expect::End)
            throw malformed({file_, lines_, ""}, "more than the counted records (got " +
                                                     in_quotes(token.text) + ")");
        const bool is_vertex = expect_ == Expect::Vertices;
        const bool rest_is_colour = expect_ == Expect::Vertices ? vertex_token(token, out)
                                                                : face_token(token, out);
        if (is_vertex && values_.empty())
        {
            // What follows on the line is read as a line of its own.
            whole_end_ = token.start + token.text.size();
            whole_lines_ = lines_ - 1;
        }
        advance();
        if (rest_is_colour)
        {
            for (Token colour; tokens.next(colour);)
                if (!parse_double(colour.text))
                    throw malformed({file_, lines_, "colour"},
                                    "is no number (got " + in_quotes(colour.text) + ")");
            return;
        }
    }
}

std::size_t OffScanner::scan(std::string_view part, std::uint64_t start, bool is_last,
                             Geometry& out)
{
    whole_end_ = start;
    whole_lines_ = lines_;
    const std::size_t done = for_each_line(part, start, is_last, lines_,
                                           [&](std::string_view text, std::uint64_t at)
                                           {
                                               if (values_.empty())
                                               {
                                                   whole_end_ = at;
                                                   whole_lines_ = lines_ - 1;
                                               }
                                               line(text, at, out);
                                           });
    if (values_.empty() || is_last)
        return done;
    // A vertex that is not whole is read again when there is more of it.
    values_.clear();
    starts_.clear();
    lines_ = whole_lines_;
    return static_cast<std::size_t>(whole_end_ - start);
}

void OffScanner::finish(Geometry& out)
{
    if (expect_ == Expect::Magic || expect_ == Expect::Counts)
        throw malformed({file_, lines_, "header"},
                        lines_ == 0 ? "the file is empty: no vertices" : "no counts");
    if (expect_ != Expect::End)
    {
        const Where where = here();
        throw malformed(
            where,
            "the file ends here (need " +
                std::to_string(expect_ == Expect::Vertices ? num_vertices_ : num_faces_) +
                ")");
    }
    if (has_normals_)
        out.attributes.push_back("normals");
    if (has_colours_)
        out.attributes.push_back("colours");
}

} // namespace cellwarp
