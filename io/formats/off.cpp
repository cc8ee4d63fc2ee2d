// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/off.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "io/base/error.h"
#include "io/base/file_limits.h"
#include "io/base/number.h"

namespace cellwarp::core
{

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
    // Prefixes, then OFF, perhaps glued to the first count. In lower case n would be the
    // prefix of another number of dimensions.
    std::size_t off = text.find("OFF");
    const bool is_lower = off == std::string_view::npos && text.find("off") <= 4;
    if (is_lower)
        off = text.find("off");
    if (off == std::string_view::npos || off > 4)
        throw malformed(here(),
                        "is no OFF file (got " + in_quotes(text) + ", need 'OFF')");
    std::string_view rest = text.substr(0, off);
    const auto take = [&](std::string_view prefix, bool& has)
    {
        if (has || !rest.starts_with(prefix))
            return false;
        rest.remove_prefix(prefix.size());
        return has = true;
    };
    while (take(is_lower ? "st" : "ST", has_texture_) ||
           take(is_lower ? "c" : "C", has_colours_) ||
           (!is_lower && take("N", has_normals_)))
        ;
    // MeshLab has the prefix N before C, and normals behind colours.
    colours_first_ = has_normals_ && has_colours_ &&
                     text.substr(0, off).find('N') < text.substr(0, off).find('C');
    if (!rest.empty())
        throw malformed(here(), "this kind of OFF is not read (got " + in_quotes(text) +
                                    ", need OFF with ST, C or N before it)");
    text.remove_prefix(off + 3);
    start += off + 3;
    if (lower_case(text).find("binary") != std::string::npos)
        throw malformed(here(), "binary OFF is not read (need the text form)");
    expect_ = Expect::Counts;
}

void OffScanner::counts(Tokens& tokens)
{
    const std::size_t before = counts_.size();
    for (Token token; tokens.next(token);)
    {
        const std::optional<std::int64_t> value = parse_integer(token.text);
        if (!value || *value < 0 || counts_.size() == 3)
            throw malformed(here(), "counts are wrong (got " + in_quotes(token.text) +
                                        ", need vertices, faces and edges)");
        counts_.push_back(*value);
    }
    // On one line the number of edges may lack; over several lines there are all three.
    if (counts_.size() < 3 && !(counts_.size() == 2 && before == 0))
        return;
    // A vertex takes at least 6 bytes ("0 0 0\n"), a face 2.
    if (counts_[0] > kMaxSamples ||
        static_cast<std::uint64_t>(counts_[0]) > (file_bytes_ + 1) / 6)
        throw malformed(here(), "the file is too short for its vertices (got " +
                                    std::to_string(counts_[0]) + ")");
    if (static_cast<std::uint64_t>(counts_[1]) > (file_bytes_ + 1) / 2)
        throw malformed(here(), "the file is too short for its faces (got " +
                                    std::to_string(counts_[1]) + ")");
    if (counts_[0] == 0)
        throw malformed(here(), "no vertices");
    num_vertices_ = static_cast<std::uint64_t>(counts_[0]);
    num_faces_ = static_cast<std::uint64_t>(counts_[1]);
    expect_ = Expect::Vertices;
    advance();
}

void OffScanner::add_number(const Token& token)
{
    const std::optional<double> value = parse_double(token.text);
    const bool is_place = values_.size() < 3;
    if (!value)
        throw malformed(here(), "is no number (got " + in_quotes(token.text) + ")");
    if (is_place && !std::isfinite(*value))
        throw malformed(here(), "is not finite (got " + in_quotes(token.text) + ")");
    values_.push_back(*value);
    numbers_.push_back(token);
}

/// From its three or six numbers.
void OffScanner::keep_vertex(Geometry& out)
{
    out.samples.emplace_back(values_[0], values_[1], values_[2]);
    out.sample_places.add(numbers_.data());
    if (has_normals_)
    {
        // A normal that is none stays as it is: it takes no part.
        const Eigen::Vector3d normal(values_[3], values_[4], values_[5]);
        out.num_bad_normals += normal.allFinite() ? 0 : 1;
        if (normal.allFinite() && !normal.isZero(0))
        {
            out.directions.push_back(normal);
            out.direction_samples.push_back(
                static_cast<std::uint32_t>(out.samples.size() - 1));
            out.direction_places.add(numbers_.data() + 3);
        }
    }
    values_.clear();
    numbers_.clear();
    ++record_;
}

bool OffScanner::vertex_token(const Token& token, Geometry& out)
{
    add_number(token);
    if (values_.size() < (has_normals_ ? 6u : 3u))
        return false;
    keep_vertex(out);
    return has_colours_ || has_texture_;
}

/// On one line: x y z, three or four numbers of a colour, the normal, perhaps two
/// texture coordinates.
void OffScanner::vertex_with_colours_first(Tokens& tokens, Geometry& out)
{
    std::vector<Token> line;
    for (Token token; tokens.next(token);)
        line.push_back(token);
    if (line.empty())
        return;
    const std::size_t least = has_texture_ ? 11 : 9;
    if (line.size() != least && line.size() != least + 1)
        throw malformed(
            here(), "got " + std::to_string(line.size()) + " numbers on the line, need " +
                        std::to_string(least) + " or " + std::to_string(least + 1));
    const std::size_t normal = line.size() - (has_texture_ ? 5 : 3);
    for (std::size_t k = 0; k < line.size(); ++k)
        if (k < 3 || (k >= normal && k < normal + 3))
            add_number(line[k]);
        else if (!parse_double(line[k].text))
            throw malformed(here(), "is no number (got " + in_quotes(line[k].text) + ")");
    keep_vertex(out);
    advance();
}

bool OffScanner::face_token(const Token& token, Geometry& out)
{
    const std::optional<std::int64_t> value = parse_integer(token.text);
    if (!value)
        throw malformed(here(), "is no index (got " + in_quotes(token.text) + ")");
    if (corners_left_ < 0)
    {
        if (*value < 0 || *value > kMaxCorners)
            throw malformed(here(), "got " + in_quotes(token.text) +
                                        " corners, need 0 to 1000000");
        is_face_ = *value >= 3;
        corners_left_ = *value;
        if (corners_left_ > 0)
            return false;
    }
    else
    {
        if (*value < 0 || *value >= static_cast<std::int64_t>(num_vertices_))
            throw malformed(here(), "vertex index is out of range (got " +
                                        in_quotes(token.text) + ", need 0 to " +
                                        std::to_string(num_vertices_ - 1) + ")");
        if (is_face_)
            out.corners.push_back(static_cast<std::uint32_t>(*value));
        if (--corners_left_ > 0)
            return false;
    }
    corners_left_ = -1;
    if (is_face_)
        out.face_ends.push_back(out.corners.size());
    ++record_;
    return true;
}

/// Start of a line's comment. "1.#IND" and its like, which older C libraries
/// write for what is no number, begin none.
std::size_t OffScanner::comment_start(std::string_view line)
{
    std::size_t at = line.find('#');
    while (at != std::string_view::npos && at >= 2 && line.substr(at - 2, 2) == "1." &&
           at + 2 < line.size() && line[at + 2] == 'N' &&
           (line[at + 1] == 'I' || line[at + 1] == 'Q' || line[at + 1] == 'S'))
        at = line.find('#', at + 1);
    return at;
}

void OffScanner::line(std::string_view text, std::uint64_t start, Geometry& out)
{
    text = text.substr(0, comment_start(text));
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
    if (expect_ == Expect::Vertices && colours_first_)
        vertex_with_colours_first(tokens, out);
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
    numbers_.clear();
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
    if (has_texture_)
        out.attributes.push_back("texture coordinates");
    if (out.num_bad_normals > 0)
        out.warnings.push_back(
            at({file_, 0, ""}, std::to_string(out.num_bad_normals) +
                                   " normals are not finite and stay as they are"));
}

} // namespace cellwarp::core
