// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/columns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "io/base/file_limits.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

/// 0..2 position, 3..5 normal, 6..8 colour; -1 for anything else.
int role_of(const std::string& name)
{
    static constexpr std::string_view names[] = {"x", "y", "z", "nx",  "ny",    "nz",
                                                 "r", "g", "b", "red", "green", "blue"};
    const auto found = std::find(std::begin(names), std::end(names), name);
    const int at = static_cast<int>(found - std::begin(names));
    return found == std::end(names) ? -1 : at < 9 ? at : at - 3;
}

Token trimmed(std::string_view text, std::uint64_t start)
{
    while (!text.empty() && is_blank(text.front()))
    {
        text.remove_prefix(1);
        ++start;
    }
    while (!text.empty() && is_blank(text.back()))
        text.remove_suffix(1);
    return {text, start};
}

/// A field without double quotes around it.
Token unquoted(const Token& field)
{
    if (field.text.size() < 2 || field.text.front() != '"' || field.text.back() != '"')
        return field;
    return trimmed(field.text.substr(1, field.text.size() - 2), field.start + 1);
}

/// The number of points that a line is; more than a file can hold count as one too many.
std::optional<std::int64_t> count_in(std::string_view line)
{
    const std::optional<std::int64_t> count = parse_integer(trimmed(line, 0).text);
    return count && *count >= 0 ? std::optional(std::min(*count, kMaxSamples + 1))
                                : std::nullopt;
}

/// Adds a scan's number of points to those of the scans before; -1: there are none.
std::int64_t with_scan(std::int64_t promised, std::int64_t count)
{
    return std::min(std::max<std::int64_t>(promised, 0) + count, kMaxSamples + 1);
}

bool is_byte(std::string_view text)
{
    const bool is_whole = text.find_first_not_of("0123456789") == std::string_view::npos;
    return is_whole && parse_double(text).value_or(256.0) <= 255.0;
}

enum class Kind
{
    UnitNormal,
    NoNormal, ///< not finite: it is none, but no colour either
    Other
};

/// Classifies columns 4 to 6 of a row.
Kind kind_of(std::span<const Token> fields)
{
    std::array<double, 3> n;
    bool is_colour = true;
    for (std::size_t k = 0; k < 3; ++k)
    {
        const Token field = unquoted(fields[k]);
        const std::optional<double> value = parse_double(field.text);
        if (!value)
            return Kind::Other;
        n[k] = *value;
        is_colour = is_colour && is_byte(field.text);
    }
    if (std::isnan(n[0]) && std::isnan(n[1]) && std::isnan(n[2]))
        return Kind::NoNormal;
    const double squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    return std::abs(squared - 1.0) < 1e-3 && !is_colour ? Kind::UnitNormal : Kind::Other;
}

/// Points that tell whether columns are normals, and how far behind the first one they
/// may begin [bytes].
constexpr int kTellingPoints = 1000;
constexpr std::uint64_t kTellingBytes = std::uint64_t(1) << 20;

} // namespace

ColumnsScanner::ColumnsScanner(std::string file, const std::string& format,
                               const std::string& columns)
    : file_(std::move(file)), is_pts_(format == "pts"), is_csv_(format == "csv")
{
    if (columns.empty())
        return;
    std::vector<std::string> names;
    for (std::size_t first = 0; first <= columns.size();)
    {
        const std::size_t end = std::min(columns.find(',', first), columns.size());
        names.push_back(columns.substr(first, end - first));
        first = end + 1;
    }
    if (!take_names(names))
        throw Error(Fault::Usage, "--columns: got " + in_quotes(columns) +
                                      ", need x, y and z among them");
}

bool ColumnsScanner::take_names(const std::vector<std::string>& names)
{
    int roles[9] = {-1, -1, -1, -1, -1, -1, -1, -1, -1};
    std::vector<std::string> lowered;
    for (std::size_t i = 0; i < names.size(); ++i)
    {
        const std::string name = lower_case(unquoted({names[i], 0}).text);
        lowered.push_back(name);
        const int role = role_of(name);
        if (role >= 0 && roles[role] < 0)
            roles[role] = static_cast<int>(i);
    }
    if (roles[0] < 0 || roles[1] < 0 || roles[2] < 0)
        return false;
    // A normal or colour counts only whole.
    for (const int group : {3, 6})
        if (roles[group] < 0 || roles[group + 1] < 0 || roles[group + 2] < 0)
            std::fill(roles + group, roles + group + 3, -1);
    std::copy(roles, roles + 9, role_column_);
    num_columns_ = names.size();
    names_ = lowered;
    has_names_ = true;
    return true;
}

void ColumnsScanner::choose_separator(std::string_view text)
{
    separator_ = ' ';
    for (const char candidate : {';', ','})
    {
        if (text.find(candidate) == std::string_view::npos)
            continue;
        // Between commas no field may hold a blank: "0,1 0,2" has decimal commas.
        std::string_view rest = text;
        bool is_separator = true;
        while (is_separator)
        {
            const std::size_t end = rest.find(candidate);
            const std::string_view field = trimmed(rest.substr(0, end), 0).text;
            is_separator = field.starts_with('"') ||
                           std::none_of(field.begin(), field.end(), is_blank);
            if (end == std::string_view::npos)
                break;
            rest.remove_prefix(end + 1);
            if (trimmed(rest, 0).text.empty())
                break;
        }
        if (is_separator)
        {
            separator_ = candidate;
            return;
        }
    }
}

/// Cuts a line into its fields.
void ColumnsScanner::split(std::string_view text, std::uint64_t start)
{
    row_.clear();
    if (separator_ == ' ')
    {
        Tokens tokens(text, start);
        for (Token token; tokens.next(token);)
            row_.push_back(token);
        return;
    }
    for (std::size_t first = 0; first <= text.size();)
    {
        // A separator inside double quotes is part of the field.
        std::size_t end = first;
        for (bool is_quoted = false;
             end < text.size() && (is_quoted || text[end] != separator_); ++end)
            is_quoted ^= text[end] == '"';
        row_.push_back(trimmed(text.substr(first, end - first), start + first));
        first = end + 1;
    }
}

void ColumnsScanner::point(Geometry& out)
{
    if (num_columns_ == 0)
    {
        num_columns_ = row_.size();
        for (int k = 0; k < 3; ++k)
            role_column_[k] = k;
        for (int k = 3; k < 6 && has_unit_normals_; ++k)
            role_column_[k] = k;
        // Whole numbers would be taken for a colour when they are read again.
        if (has_unit_normals_)
            out.direction_places.scalars.fill(Scalar::TextReal);
    }
    if (row_.size() != num_columns_ || row_.size() < 3)
        throw malformed({file_, lines_, "point"},
                        "got " + std::to_string(row_.size()) + " columns, need " +
                            std::to_string(std::max<std::size_t>(3, num_columns_)));
    double values[9];
    Token fields[9];
    for (int role = 0; role < 9; ++role)
    {
        if (role_column_[role] < 0)
            continue;
        const Token field = unquoted(row_[static_cast<std::size_t>(role_column_[role])]);
        const std::optional<double> value = parse_double(field.text);
        // Put together where something is wrong alone: there are millions of numbers.
        const auto wrong = [&](const char* how)
        {
            return malformed(
                {file_, lines_, "column " + std::to_string(role_column_[role] + 1)},
                std::string(how) + " (got " + in_quotes(field.text) + ")");
        };
        if (!value)
            throw wrong("is no number");
        if (role < 3 && !std::isfinite(*value))
            throw wrong("is not finite");
        values[role] = *value;
        fields[role] = field;
    }
    out.samples.emplace_back(values[0], values[1], values[2]);
    out.sample_places.add(fields);
    if (role_column_[3] >= 0)
    {
        const Eigen::Vector3d normal(values[3], values[4], values[5]);
        if (normal.allFinite() && !normal.isZero(0))
        {
            out.directions.push_back(normal);
            out.direction_samples.push_back(
                static_cast<std::uint32_t>(out.samples.size() - 1));
            out.direction_places.add(fields + 3);
        }
    }
    if (role_column_[6] >= 0)
    {
        std::array<std::uint8_t, 3>& colour = out.colours.emplace_back();
        for (int k = 0; k < 3; ++k)
            colour[static_cast<std::size_t>(k)] =
                static_cast<std::uint8_t>(std::clamp(values[6 + k], 0.0, 255.0));
    }
}

bool ColumnsScanner::is_point(std::string_view text, std::uint64_t start)
{
    const Token whole = trimmed(text, start);
    std::string_view content = whole.text;
    if (content.empty() || content.front() == '#')
        return false;
    const bool is_marked = content.starts_with("//");
    if (is_marked)
        content.remove_prefix(2);
    if (trimmed(content, 0).text.empty())
        return false;
    const std::optional<std::int64_t> count = count_in(whole.text);
    if (count && (is_pts_ || (!has_points_ && promised_ < 0)))
    {
        promised_ = with_scan(promised_, *count);
        count_line_ = count_line_ == 0 ? lines_ : count_line_;
        is_first_ = false;
        return false;
    }
    if (separator_ == 0 || is_first_)
        choose_separator(trimmed(content, 0).text);
    split(content, whole.start + (is_marked ? 2 : 0));
    if (is_first_ || (is_pts_ && !has_points_))
    {
        std::vector<std::string> names;
        for (const Token& field : row_)
            names.emplace_back(field.text);
        const bool is_text = !row_.empty() && !parse_double(unquoted(row_[0]).text);
        if (is_text &&
            (has_names_ ? row_.size() == num_columns_ && !is_marked : take_names(names)))
        {
            is_first_ = false;
            return false;
        }
        if (is_text && is_csv_ && !is_marked)
            throw malformed(
                {file_, lines_, "names"},
                "no columns x, y and z among them (say which with --columns)");
    }
    if (is_marked)
        return false; // a comment
    // A lone number that no point follows counted none: it was a point itself.
    if (!is_pts_ && !has_points_ && promised_ >= 0 &&
        (row_.size() < 3 || !parse_double(unquoted(row_[0]).text)))
        throw malformed({file_, count_line_, "point"}, "got 1 columns, need 3");
    is_first_ = false;
    has_points_ = true;
    return true;
}

std::optional<bool> ColumnsScanner::find_normals(std::string_view part,
                                                 std::uint64_t start, bool is_last) const
{
    ColumnsScanner ahead = *this;
    const std::size_t skipped = start == 0 ? byte_order_mark(part) : 0;
    LineReader lines(part.substr(skipped), start + skipped, is_last, lines_);
    std::uint64_t first = 0;
    int points = 0;
    bool has_normal = false;
    for (std::string_view line; lines.next(line);)
    {
        ahead.lines_ = lines.line_number();
        if (!ahead.is_point(line, lines.line_start()))
            continue;
        first = points == 0 ? lines.line_start() : first;
        const Kind kind = ahead.row_.size() == 6
                              ? kind_of(std::span(ahead.row_).subspan(3))
                              : Kind::Other;
        if (kind == Kind::Other)
            return false;
        has_normal |= kind == Kind::UnitNormal;
        if (++points == kTellingPoints || lines.line_start() - first >= kTellingBytes)
            return has_normal;
    }
    // Without a point in it the part can be read as it is.
    return is_last || points == 0 ? std::optional(has_normal) : std::nullopt;
}

std::size_t ColumnsScanner::scan(std::string_view part, std::uint64_t start, bool is_last,
                                 Geometry& out)
{
    if (num_columns_ == 0)
    {
        const std::optional<bool> has_normals = find_normals(part, start, is_last);
        if (!has_normals)
            return 0;
        has_unit_normals_ = *has_normals;
    }
    return for_each_line(part, start, is_last, lines_,
                         [&](std::string_view text, std::uint64_t at)
                         {
                             if (is_point(text, at))
                                 point(out);
                         });
}

std::size_t ColumnsScanner::skip(std::string_view part)
{
    if (!has_points_)
        return 0;
    LineReader lines(part.substr(0, part.rfind('\n') + 1), 0, true, lines_);
    for (std::string_view line; lines.next(line);)
    {
        lines_ = lines.line_number();
        if (is_pts_)
            if (const std::optional<std::int64_t> count = count_in(line))
                promised_ = with_scan(promised_, *count);
    }
    return lines.consumed();
}

void ColumnsScanner::finish(Geometry& out)
{
    if (out.num_samples() == 0)
        throw malformed({file_, 0, ""}, "the file is empty: no vertices");
    if (promised_ >= 0 && promised_ != static_cast<std::int64_t>(out.num_samples()))
        throw malformed({file_, count_line_, "count"},
                        "got " + std::to_string(promised_) + " points, need " +
                            std::to_string(out.num_samples()));
    static constexpr const char* roles[] = {"x",  "y", "z", "nx", "ny",
                                            "nz", "r", "g", "b"};
    for (std::size_t i = 0; i < num_columns_; ++i)
    {
        const auto role =
            std::find(role_column_, role_column_ + 9, static_cast<int>(i)) - role_column_;
        const std::string name =
            i < names_.size() ? names_[i] : "column " + std::to_string(i + 1);
        out.columns.push_back(role < 9 ? roles[role] : name);
        if (role == 9)
            out.attributes.push_back(name);
    }
    if (role_column_[3] >= 0)
        out.attributes.push_back("normals");
    if (role_column_[6] >= 0)
        out.attributes.push_back("colours");
}

} // namespace cellwarp::core
