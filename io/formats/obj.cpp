// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/obj.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "io/base/error.h"
#include "io/base/file_limits.h"
#include "io/base/number.h"
#include "io/base/text.h"

namespace cellwarp::core
{

namespace
{

/// A face corner as written: "v", "v/vt", "v//vn" or "v/vt/vn"; 0 where missing.
struct Corner
{
    std::int64_t vertex = 0, texture = 0, normal = 0;
    Token normal_token = {};
};

bool parse_corner(const Token& token, Corner& corner)
{
    std::string_view rest = token.text;
    std::uint64_t start = token.start;
    if (const std::optional<std::int64_t> alone = parse_integer(rest)) // as most are
    {
        corner.vertex = *alone;
        return *alone != 0;
    }
    for (int part = 0; part < 3; ++part)
    {
        const std::size_t slash = rest.find('/');
        const std::string_view text = rest.substr(0, slash);
        // An empty index of vt or vn is none, and so is 0.
        if (!text.empty() || part == 0)
        {
            const std::optional<std::int64_t> index = parse_integer(text);
            if (!index || (*index == 0 && part == 0))
                return false;
            (part == 0   ? corner.vertex
             : part == 1 ? corner.texture
                         : corner.normal) = *index;
            if (part == 2)
                corner.normal_token = {text, start};
        }
        if (slash == std::string_view::npos)
            return true;
        rest.remove_prefix(slash + 1);
        start += slash + 1;
    }
    return false;
}

bool is_keyword(std::string_view word)
{
    return std::all_of(word.begin(), word.end(),
                       [](char c)
                       {
                           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                                  (c >= '0' && c <= '9') || c == '_';
                       });
}

/// The statements that the format knows and that hold nothing for us.
bool passes_through(std::string_view word)
{
    static constexpr std::string_view known[] = {
        "vt",     "vp",         "p",        "s",     "mg",       "usemtl",   "mtllib",
        "usemap", "maplib",     "curv",     "curv2", "surf",     "parm",     "trim",
        "hole",   "scrv",       "sp",       "end",   "con",      "deg",      "bmat",
        "step",   "cstype",     "bevel",    "lod",   "c_interp", "d_interp", "ctech",
        "stech",  "res",        "bsp",      "bzp",   "cdc",      "cdp",      "call",
        "csh",    "shadow_obj", "trace_obj"};
    return std::find(std::begin(known), std::end(known), word) != std::end(known);
}

bool has_comment(std::string_view line)
{
    for (std::size_t at = line.find('#'); at != std::string_view::npos;
         at = line.find('#', at + 1))
        if (at == 0 || is_blank(line[at - 1]))
            return true;
    return false;
}

std::string_view first_word(std::string_view line)
{
    Tokens tokens(line, 0);
    Token word;
    tokens.next(word);
    return word.text;
}

/// Whether the backslash at the end of a statement continues it: that of a name (a
/// folder, say) does not if the next line is a statement.
bool is_continued(std::string_view statement, std::string_view next_line)
{
    static constexpr std::string_view of_names[] = {"mtllib", "usemtl", "usemap",
                                                    "maplib", "o",      "g"};
    static constexpr std::string_view begins[] = {
        "v", "vn", "vt", "vp", "f", "fo", "l", "p", "g", "o", "usemtl", "s", "mtllib"};
    const auto is_among = [](const auto& words, std::string_view word)
    { return std::find(std::begin(words), std::end(words), word) != std::end(words); };
    return !is_among(of_names, first_word(statement)) ||
           !is_among(begins, first_word(next_line));
}

} // namespace

std::size_t ObjScanner::scan(std::string_view part, std::uint64_t start, bool is_last,
                             Geometry& out)
{
    std::size_t skipped = start == 0 ? byte_order_mark(part) : 0;
    LineReader lines(part.substr(skipped), start + skipped, is_last, lines_);
    std::size_t done = skipped;
    std::string_view line, next;
    for (bool is_read = false; is_read || lines.next(line);)
    {
        // A backslash continues the statement; it and the line end become blanks,
        // so that every token keeps its place.
        const std::uint64_t first = lines.line_start();
        const std::int64_t number = lines.line_number();
        std::string_view last = line;
        is_read = false;
        if (line.ends_with('\\') && !has_comment(line))
            joined_ = line;
        while (last.ends_with('\\') && !has_comment(last))
        {
            if (!lines.next(next))
            {
                if (!is_last)
                    return done;
                joined_.pop_back();
                line = joined_;
                break;
            }
            if (!is_continued(joined_, next))
            {
                is_read = true;
                line = joined_;
                break;
            }
            joined_.pop_back();
            joined_.resize(lines.line_start() - first, ' ');
            joined_.append(next);
            line = joined_;
            last = next;
        }
        if (line.size() > (std::size_t(1) << 24))
            throw malformed({file_, number, ""}, "the line is longer than 16 MB");
        statement(line, first, number, out);
        done = is_read ? static_cast<std::size_t>(lines.line_start() - start)
                       : skipped + lines.consumed();
        lines_ = lines.line_number() - (is_read ? 1 : 0);
        if (is_read)
            line = next;
    }
    return done;
}

void for_each_obj_statement(std::string_view text,
                            const std::function<void(std::string_view)>& visit)
{
    ObjScanner scanner("");
    scanner.visit_ = visit;
    Geometry unused;
    scanner.scan(text, 0, true, unused);
}

void ObjScanner::statement(std::string_view line, std::uint64_t start,
                           std::int64_t number, Geometry& out)
{
    if (visit_)
        return visit_(line);
    Tokens tokens(line, start);
    Token word;
    if (!tokens.next(word) || word.text[0] == '#')
        return;
    if (word.text == "v")
        vertex(tokens, number, out);
    else if (word.text == "vn")
        normal(tokens, number, out);
    else if (word.text == "f" || word.text == "fo")
        face(tokens, number, out);
    else if (word.text == "l")
        drawn_line(tokens, number, out);
    else if (word.text == "g" || word.text == "o")
    {
        close_groups(out);
        if (word.text == "o")
            object_ = tokens.rest();
        else
        {
            open_groups_.clear();
            for (Token name; tokens.next(name);)
                open_groups_.emplace_back(name.text);
        }
    }
    else if (word.text == "vt")
        ++num_texture_;
    else if (!passes_through(word.text))
    {
        if (!is_keyword(word.text))
            throw malformed({file_, number, ""}, "this is no OBJ statement (got " +
                                                     in_quotes(word.text) + ")");
        ++num_unknown_;
    }
}

namespace
{

/// The numbers of a statement, at most eight, each with its place.
struct Numbers
{
    int count = 0;
    std::array<double, 8> values;
    std::array<Token, 8> tokens;

    Eigen::Vector3d vector() const { return {values[0], values[1], values[2]}; }
};

/// The first \p num_finite of them have to be finite.
Numbers read_numbers(Tokens& tokens, const std::string& file, std::int64_t line,
                     int num_finite)
{
    Numbers numbers;
    for (Token token; tokens.next(token) && token.text[0] != '#'; ++numbers.count)
    {
        // Put together where something is wrong alone: there are millions of numbers.
        const auto wrong = [&](const std::string& reason)
        {
            return malformed({file, line, "number " + std::to_string(numbers.count + 1)},
                             reason);
        };
        if (numbers.count == 8)
            throw wrong("one too many (need at most 8)");
        const std::optional<double> value = parse_double(token.text);
        if (!value)
            throw wrong("is no number (got " + in_quotes(token.text) + ")");
        if (numbers.count < num_finite && !std::isfinite(*value))
            throw wrong("is not finite (got " + in_quotes(token.text) + ")");
        numbers.values[static_cast<std::size_t>(numbers.count)] = *value;
        numbers.tokens[static_cast<std::size_t>(numbers.count)] = token;
    }
    return numbers;
}

/// Of a number as it is written; with an exponent as many as can be.
int decimals_of(std::string_view text)
{
    if (text.find_first_of("eE") != std::string_view::npos)
        return Geometry::kMostDecimals;
    const std::size_t point = text.find('.');
    return point == std::string_view::npos ? 0
                                           : static_cast<int>(text.size() - 1 - point);
}

} // namespace

void ObjScanner::vertex(Tokens& tokens, std::int64_t line, Geometry& out)
{
    // x y z, x y z w, x y z r g b, x y z w r g b or x y z w r g b a.
    const Numbers numbers = read_numbers(tokens, file_, line, 3);
    if (numbers.count < 3 || numbers.count == 5)
        throw malformed({file_, line, "vertex"}, "got " + std::to_string(numbers.count) +
                                                     " numbers, need 3, 4, 6, 7 or 8");
    out.samples.push_back(numbers.vector());
    if (static_cast<std::int64_t>(out.num_samples()) > kMaxSamples)
        throw malformed({file_, line, "vertex"}, "more than 2147483647 of them");
    out.sample_places.add(numbers.tokens.data());
    if (numbers.count < 6)
        return;
    out.colours.resize(out.samples.size(), {200, 200, 200});
    for (std::size_t k = 0; k < 3; ++k)
    {
        const std::size_t first = numbers.count == 6 ? 3 : 4;
        const double share = numbers.values[first + k];
        if (!std::isnan(share)) // else it stays grey
            out.colours.back()[k] = static_cast<std::uint8_t>(
                std::lround(255.0 * std::clamp(share, 0.0, 1.0)));
    }
}

void ObjScanner::normal(Tokens& tokens, std::int64_t line, Geometry& out)
{
    const Numbers numbers = read_numbers(tokens, file_, line, 0);
    if (numbers.count != 3)
        throw malformed({file_, line, "normal"},
                        "got " + std::to_string(numbers.count) + " numbers, need 3");
    const bool is_finite = numbers.vector().allFinite();
    out.num_bad_normals += is_finite ? 0 : 1; // it keeps its number
    out.directions.push_back(numbers.vector());
    for (std::size_t k = 0;
         is_finite && k < 3 && out.direction_decimals < Geometry::kMostDecimals; ++k)
        out.direction_decimals = std::min(
            Geometry::kMostDecimals,
            std::max(out.direction_decimals, decimals_of(numbers.tokens[k].text)));
    out.direction_places.add(numbers.tokens.data());
}

void ObjScanner::face(Tokens& tokens, std::int64_t line, Geometry& out)
{
    const char* const field = "face index";
    const std::size_t first = out.corners.size();
    for (Token token; tokens.next(token) && token.text[0] != '#';)
    {
        Corner corner;
        if (!parse_corner(token, corner))
            throw malformed({file_, line, field},
                            "is no index (got " + in_quotes(token.text) +
                                ", need v, v/vt, v//vn or v/vt/vn)");
        out.corners.push_back(resolve(corner.vertex,
                                      static_cast<std::int64_t>(out.num_samples()), line,
                                      field, forward_vertex_));
        const std::uint32_t direction =
            corner.normal == 0
                ? kNone
                : normal_of(corner.normal,
                            static_cast<std::int64_t>(out.num_directions()), line);
        if (direction != kNone)
        {
            out.corner_directions.resize(out.corners.size() - 1, kNone);
            out.corner_direction_starts.pad(out.corners.size() - 1);
            out.corner_direction_lengths.pad(out.corners.size() - 1);
            out.corner_directions.push_back(direction);
            out.corner_direction_starts.push_back(corner.normal_token.start);
            out.corner_direction_lengths.push_back(corner.normal_token.text.size());
        }
    }
    const std::size_t count = out.corners.size() - first;
    if (count > kMaxCorners)
        throw malformed({file_, line, "face"},
                        "got " + std::to_string(count) + " corners, need 0 to 1000000");
    if (count >= 3)
    {
        out.face_ends.push_back(out.corners.size());
        return;
    }
    // No face. Two corners are a loose edge.
    if (count == 2)
        out.lines.push_back({out.corners[first], out.corners[first + 1]});
    out.corners.resize(first);
    if (out.corner_directions.size() > first)
    {
        out.corner_directions.resize(first);
        out.corner_direction_starts.truncate(first);
        out.corner_direction_lengths.truncate(first);
    }
}

void ObjScanner::drawn_line(Tokens& tokens, std::int64_t line, Geometry& out)
{
    const char* const field = "line index";
    std::size_t count = 0;
    std::uint32_t last = 0;
    for (Token token; tokens.next(token) && token.text[0] != '#'; ++count)
    {
        Corner place;
        if (!parse_corner(token, place) || place.normal != 0)
            throw malformed({file_, line, field}, "is no index (got " +
                                                      in_quotes(token.text) +
                                                      ", need v or v/vt)");
        const std::uint32_t sample =
            resolve(place.vertex, static_cast<std::int64_t>(out.num_samples()), line,
                    field, forward_vertex_);
        if (count > 0)
            out.lines.push_back({last, sample});
        last = sample;
    }
    if (count < 2)
        throw malformed({file_, line, "line"},
                        "got " + std::to_string(count) + " places, need at least 2");
}

std::uint32_t ObjScanner::resolve(std::int64_t index, std::int64_t read,
                                  std::int64_t line, const char* field,
                                  Forward& forward) const
{
    const std::int64_t value = index > 0 ? index - 1 : read + index;
    if (value < 0 || value >= kMaxSamples)
        throw malformed({file_, line, field}, "is out of range (got " +
                                                  std::to_string(index) + ", " +
                                                  std::to_string(read) + " read so far)");
    if (value >= read && value > forward.index)
        forward = {value, line, field};
    return static_cast<std::uint32_t>(value);
}

/// Resolves a normal index; kNone if the file has no such normal.
std::uint32_t ObjScanner::normal_of(std::int64_t index, std::int64_t read,
                                    std::int64_t line)
{
    const std::int64_t value = index > 0 ? index - 1 : read + index;
    if (value < 0 || value >= kMaxSamples)
    {
        if (lacking_normal_.line == 0)
            lacking_normal_ = {index, line};
        return kNone;
    }
    if (value >= read && value > forward_normal_.index)
        forward_normal_ = {value, line};
    return static_cast<std::uint32_t>(value);
}

void ObjScanner::close_groups(Geometry& out)
{
    const std::size_t end = out.face_ends.size();
    if (end > groups_first_face_)
    {
        for (const std::string& name : open_groups_)
            out.groups.push_back({name, groups_first_face_, end});
        if (!object_.empty())
            out.groups.push_back({object_, groups_first_face_, end});
    }
    groups_first_face_ = end;
}

void ObjScanner::finish(Geometry& out)
{
    close_groups(out);
    if (forward_vertex_.index >= static_cast<std::int64_t>(out.num_samples()))
        throw malformed({file_, forward_vertex_.line, forward_vertex_.field},
                        "is out of range (got " +
                            std::to_string(forward_vertex_.index + 1) +
                            ", need at most " + std::to_string(out.num_samples()) + ")");
    if (out.num_samples() == 0)
        throw malformed({file_, 0, ""},
                        lines_ == 0 ? "the file is empty: no vertices" : "no vertices");
    if (!out.colours.empty())
        out.colours.resize(out.samples.size(), {200, 200, 200});
    if (!out.corner_directions.empty())
    {
        for (std::uint32_t& direction : out.corner_directions)
            if (direction != kNone && (direction >= out.directions.size() ||
                                       !out.directions[direction].allFinite()))
                direction = kNone;
        out.corner_directions.resize(out.corners.size(), kNone);
        out.corner_direction_starts.pad(out.corners.size());
        out.corner_direction_lengths.pad(out.corners.size());
    }
    if (num_texture_ > 0)
        out.attributes.push_back("texture coordinates");
    if (!out.directions.empty())
        out.attributes.push_back("normals");
    if (!out.colours.empty())
        out.attributes.push_back("colours");
    if (!out.groups.empty())
        out.attributes.push_back("groups");
    if (forward_normal_.index >= static_cast<std::int64_t>(out.num_directions()))
        lacking_normal_ = {forward_normal_.index + 1, forward_normal_.line};
    if (lacking_normal_.line > 0)
        out.warnings.push_back(at({file_, lacking_normal_.line, "face index"},
                                  "the file has no normal " +
                                      std::to_string(lacking_normal_.index) + " (of " +
                                      std::to_string(out.num_directions()) +
                                      "): corners without one stay as they are"));
    if (out.num_bad_normals > 0)
        out.warnings.push_back(
            at({file_, 0, ""}, std::to_string(out.num_bad_normals) +
                                   " normals are not finite and stay as they are"));
    if (num_unknown_ > 0)
        out.warnings.push_back(
            at({file_, 0, ""},
               std::to_string(num_unknown_) + " unknown statements pass through"));
}

DirectionSplitter::DirectionSplitter(std::size_t num_directions, int decimals,
                                     std::string line_end)
    : num_directions_(num_directions), line_end_(std::move(line_end)),
      // Whole numbers are mostly exact: they do not stand for what is half a one away.
      same_(std::clamp(0.5 * std::pow(10.0, -decimals), 1e-6, 5e-5))
{
}

std::size_t DirectionSplitter::BoxHash::operator()(const Box& box) const
{
    std::size_t hash = 0;
    for (const std::int64_t k : box)
        hash = (hash ^ static_cast<std::size_t>(k)) * 0x9e3779b97f4a7c15u;
    return hash ^ (hash >> 32);
}

DirectionSplitter::Box DirectionSplitter::box_of(const Eigen::Vector3d& value) const
{
    Box box;
    for (int k = 0; k < 3; ++k)
        box[static_cast<std::size_t>(k)] =
            static_cast<std::int64_t>(std::floor(value[k] / edge_));
    return box;
}

/// The first statement of this direction that is near enough; null: none.
const DirectionSplitter::Statement*
DirectionSplitter::near(const Eigen::Vector3d& value) const
{
    const double tolerance = same_ * value.norm();
    const auto is_near = [&](const Statement& statement)
    { return (statement.value - value).norm() <= tolerance; };
    // Boxes are good for directions of about the first one's length.
    if (edge_ == 0.0 || tolerance > 0.75 * edge_ || tolerance < 1e-6 * edge_)
    {
        const auto found = std::find_if(statements_.begin(), statements_.end(), is_near);
        return found == statements_.end() ? nullptr : &*found;
    }
    const Box centre = box_of(value);
    std::uint32_t first = kNone;
    for (int neighbour = 0; neighbour < 27; ++neighbour)
    {
        const auto found =
            boxes_.find({centre[0] + neighbour % 3 - 1, centre[1] + neighbour / 3 % 3 - 1,
                         centre[2] + neighbour / 9 - 1});
        if (found == boxes_.end())
            continue;
        for (const std::uint32_t i : found->second)
            if (i < first && is_near(statements_[i]))
                first = i;
    }
    return first == kNone ? nullptr : &statements_[first];
}

void DirectionSplitter::keep(const Statement& statement)
{
    // A flat mesh may share one vn among all its vertices.
    constexpr std::size_t kMany = 32;
    statements_.push_back(statement);
    const double length = statements_.front().value.norm();
    const bool fits = std::isfinite(1.0 / length) && std::isfinite(length);
    std::size_t next = statements_.size() - 1;
    if (statements_.size() == kMany && fits)
    {
        edge_ = 2.0 * same_ * length;
        next = 0;
    }
    for (; edge_ > 0.0 && next < statements_.size(); ++next)
        // What is far longer than the first is looked for one by one.
        if (statements_[next].value.norm() <= 1e6 * length)
            boxes_[box_of(statements_[next].value)].push_back(
                static_cast<std::uint32_t>(next));
}

std::uint32_t DirectionSplitter::index(const DirectionUse& use,
                                       const Eigen::Vector3d& value, std::string& lines)
{
    if (use.direction != direction_)
    {
        statements_.clear();
        boxes_.clear();
        edge_ = 0.0;
    }
    direction_ = use.direction;
    if (const Statement* const statement = near(value))
        return statement->index;
    std::uint32_t index = use.direction + 1;
    if (!statements_.empty())
    {
        ++num_lines_;
        index = static_cast<std::uint32_t>(num_directions_ + num_lines_);
        lines += "vn";
        for (const double x : value)
            lines += " " + shortest(x);
        lines += line_end_;
    }
    keep({value, index});
    return index;
}

ObjSplit split_directions(const Geometry& geometry, const std::vector<DirectionUse>& uses,
                          const std::vector<Eigen::Vector3d>& values,
                          std::string_view bytes)
{
    ObjSplit split;
    split.directions = geometry.directions;
    std::vector<std::uint32_t> index_of_use;
    const std::string line_end =
        bytes.find("\r\n") != std::string_view::npos ? "\r\n" : "\n";
    DirectionSplitter splitter(geometry.directions.size(), geometry.direction_decimals,
                               line_end);
    for (std::size_t use = 0; use < uses.size(); ++use)
    {
        const std::uint32_t direction = uses[use].direction;
        if (use == 0 || direction != uses[use - 1].direction)
            split.directions[direction] = values[use];
        index_of_use.push_back(splitter.index(uses[use], values[use], split.lines));
    }
    split.num_lines = splitter.num_lines();
    if (split.num_lines == 0)
        return split;
    const std::string_view text = without_end_mark(bytes, 0);
    if (!text.empty() && text.back() != '\n' && text.back() != '\r')
        split.lines.insert(0, line_end);
    for (std::size_t c = 0; c < geometry.corner_directions.size(); ++c)
    {
        if (geometry.corner_directions[c] == kNone)
            continue;
        const DirectionUse wanted{geometry.corner_directions[c], geometry.corners[c]};
        const auto use =
            std::lower_bound(uses.begin(), uses.end(), wanted,
                             [](const DirectionUse& a, const DirectionUse& b) {
                                 return std::pair(a.direction, a.sample) <
                                        std::pair(b.direction, b.sample);
                             });
        const std::uint32_t index =
            index_of_use[static_cast<std::size_t>(use - uses.begin())];
        if (index != wanted.direction + 1)
            split.indices.push_back({geometry.corner_direction_starts[c],
                                     geometry.corner_direction_lengths[c], index});
    }
    return split;
}

} // namespace cellwarp::core
