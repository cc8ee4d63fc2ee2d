// SPDX-License-Identifier: GPL-3.0-or-later
// Text in lines and tokens, with the place of each, for every text format.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace cellwarp::core
{

/// A token and where it starts.
struct Token
{
    std::string_view text;
    std::uint64_t start = 0; ///< [byte] from the beginning of the file
};

/// The byte order mark that UTF-8 files may start with, or nothing.
std::size_t byte_order_mark(std::string_view bytes);

/// The end of a file, from byte \p start of it on, without the one NUL or Ctrl-Z that
/// some programs put behind the last line end.
std::string_view without_end_mark(std::string_view text, std::uint64_t start);

/// Hands out the lines of a text: ended by LF, CR LF or CR, the last one perhaps
/// by nothing. With \p is_last false a line that is not ended is held back, else an end
/// mark is left out.
class LineReader
{
public:
    LineReader(std::string_view text, std::uint64_t start, bool is_last,
               std::int64_t lines_before = 0)
        : text_(is_last ? without_end_mark(text, start) : text), size_(text.size()),
          start_(start), is_last_(is_last),
          has_cr_(text.find('\r') != std::string_view::npos), line_(lines_before)
    {
    }

    /// False at the end. The line comes without its end.
    bool next(std::string_view& line);
    /// Number of the line that next() gave last, from 1.
    std::int64_t line_number() const { return line_; }
    /// Where that line starts [byte].
    std::uint64_t line_start() const { return line_start_; }
    /// How much of the text has been handed out [byte].
    std::size_t consumed() const { return next_ == text_.size() ? size_ : next_; }

private:
    std::string_view text_;
    std::size_t size_; ///< with the end mark
    std::uint64_t start_;
    bool is_last_;
    bool has_cr_; ///< anywhere: few files have, and need not be searched again
    std::int64_t line_;
    std::uint64_t line_start_ = 0;
    std::size_t next_ = 0;
};

/// Calls visit(line, start) for the complete lines of \p part, a byte order mark at the
/// file's beginning left out, and keeps \p lines at the number of the line. Returns
/// how many bytes they take.
template <class Visit>
std::size_t for_each_line(std::string_view part, std::uint64_t start, bool is_last,
                          std::int64_t& lines, Visit&& visit)
{
    const std::size_t skipped = start == 0 ? byte_order_mark(part) : 0;
    LineReader reader(part.substr(skipped), start + skipped, is_last, lines);
    for (std::string_view line; reader.next(line);)
    {
        lines = reader.line_number();
        visit(line, reader.line_start());
    }
    return skipped + reader.consumed();
}

inline bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

/// Cuts a line into tokens at blanks and tabs.
class Tokens
{
public:
    Tokens(std::string_view line, std::uint64_t start) : rest_(line), start_(start) {}
    /// False at the end of the line.
    bool next(Token& token)
    {
        std::size_t first = 0;
        while (first < rest_.size() && is_blank(rest_[first]))
            ++first;
        std::size_t end = first;
        while (end < rest_.size() && !is_blank(rest_[end]))
            ++end;
        token = {rest_.substr(first, end - first), start_ + first};
        rest_.remove_prefix(end);
        start_ += end;
        return !token.text.empty();
    }
    /// What is left, without leading blanks.
    std::string_view rest() const;

private:
    std::string_view rest_;
    std::uint64_t start_;
};

/// A blank, or the # of a comment.
inline bool is_end_of_word(char c)
{
    return is_blank(c) || c == '#';
}

/// The word with A to Z in lower case, in every locale.
std::string lower_case(std::string_view word);

/// A guess at what bytes are that cannot be the text they should be ("a git LFS
/// pointer", "a ZIP archive", "UTF-16 text"); empty if nothing speaks against it.
std::string foreign_content(std::string_view bytes);

/// The same for bytes from the middle of a file.
std::string foreign_bytes(std::string_view bytes);

/// "obj" of "dir/Name.OBJ"; empty without an extension.
std::string extension_of(const std::string& path);

} // namespace cellwarp::core
