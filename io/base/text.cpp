// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/text.h"

#include <cstring>
#include <filesystem>

namespace cellwarp::core
{

std::string_view without_end_mark(std::string_view text, std::uint64_t start)
{
    if (text.empty() || (text.back() != '\0' && text.back() != '\x1a'))
        return text;
    const std::string_view rest = text.substr(0, text.size() - 1);
    const bool is_behind_line = rest.empty() ? start > 0 // a part begins with a line
                                             : rest.back() == '\n' || rest.back() == '\r';
    return is_behind_line ? rest : text;
}

bool LineReader::next(std::string_view& line)
{
    if (next_ >= text_.size())
        return false;
    const std::string_view rest = text_.substr(next_);
    const char* lf =
        static_cast<const char*>(std::memchr(rest.data(), '\n', rest.size()));
    const std::size_t until_lf =
        lf ? static_cast<std::size_t>(lf - rest.data()) : rest.size();
    const char* cr =
        has_cr_ ? static_cast<const char*>(std::memchr(rest.data(), '\r', until_lf))
                : nullptr;
    std::size_t length = until_lf;
    std::size_t end = lf ? until_lf + 1 : rest.size();
    bool is_ended = lf != nullptr;
    if (cr)
    {
        length = static_cast<std::size_t>(cr - rest.data());
        // A CR at the very end may be the first half of CR LF.
        is_ended = length + 1 < rest.size();
        end = length + 1 + (is_ended && rest[length + 1] == '\n' ? 1 : 0);
    }
    if (!is_ended && !is_last_)
        return false;
    line = rest.substr(0, length);
    line_start_ = start_ + next_;
    next_ += end;
    ++line_;
    return true;
}

std::string_view Tokens::rest() const
{
    std::string_view rest = rest_;
    while (!rest.empty() && is_blank(rest.front()))
        rest.remove_prefix(1);
    while (!rest.empty() && is_blank(rest.back()))
        rest.remove_suffix(1);
    return rest;
}

std::string lower_case(std::string_view word)
{
    std::string text(word);
    for (char& c : text)
        c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return text;
}

std::string foreign_content(std::string_view bytes)
{
    using namespace std::literals;
    if (bytes.starts_with("PK\x03\x04"sv))
        return "a ZIP archive";
    if (bytes.starts_with("\x1f\x8b"sv))
        return "gzip-compressed data";
    if (bytes.starts_with("\xff\xfe"sv) || bytes.starts_with("\xfe\xff"sv))
        return "UTF-16 text";
    if (bytes.starts_with("version https://git-lfs"sv))
        return "a git LFS pointer";
    if (bytes.starts_with("glTF"sv))
        return "a binary glTF";
    const std::string_view head = bytes.substr(0, 512);
    for (const std::string_view tag : {"<!DOCTYPE"sv, "<html"sv, "<HTML"sv, "<?xml"sv})
        if (head.find(tag) != std::string_view::npos)
            return "an HTML or XML page";
    return foreign_bytes(bytes);
}

std::string foreign_bytes(std::string_view bytes)
{
    return bytes.find('\0') == std::string_view::npos ? "" : "binary data (a NUL byte)";
}

std::size_t byte_order_mark(std::string_view bytes)
{
    return bytes.starts_with("\xef\xbb\xbf") ? 3 : 0;
}

std::string extension_of(const std::string& path)
{
    std::string extension = std::filesystem::path(path).extension().string();
    if (!extension.empty())
        extension.erase(0, 1);
    return lower_case(extension);
}

} // namespace cellwarp::core
