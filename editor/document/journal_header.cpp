// SPDX-License-Identifier: GPL-3.0-or-later
// Each part is its length, a blank, its bytes.
#include "editor/document/journal_header.h"

#include <charconv>

#include "io/base/error.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

void put(std::string& text, std::string_view part)
{
    text += std::to_string(part.size());
    text += ' ';
    text += part;
}

class HeaderParts
{
public:
    HeaderParts(std::string_view text, const std::string& path) : text_(text), path_(path)
    {
    }

    std::string_view next()
    {
        std::size_t size = 0;
        const auto read =
            std::from_chars(text_.data(), text_.data() + text_.size(), size);
        const std::size_t digits = idx(read.ptr - text_.data());
        if (read.ec != std::errc() || digits >= text_.size() || text_[digits] != ' ' ||
            size > text_.size() - digits - 1)
            fail();
        const std::string_view part = text_.substr(digits + 1, size);
        text_.remove_prefix(digits + 1 + size);
        return part;
    }

    template <class Number>
    Number number()
    {
        const std::string_view part = next();
        Number number = 0;
        const char* const end = part.data() + part.size();
        const auto read = std::from_chars(part.data(), end, number);
        if (read.ec != std::errc() || read.ptr != end)
            fail();
        return number;
    }

private:
    [[noreturn]] void fail() const
    {
        throw malformed({path_, 0, "header"}, "does not tell what was edited");
    }

    std::string_view text_;
    const std::string& path_;
};

} // namespace

std::string header_text(const JournalHeader& header)
{
    std::string text;
    put(text, header.document);
    put(text, header.scene);
    put(text, header.handles);
    put(text, header.handles_path);
    put(text, std::to_string(header.model_bytes));
    put(text, std::to_string(header.model_checksum));
    return text;
}

JournalHeader parse_header(std::string_view text, const std::string& path)
{
    HeaderParts parts(text, path);
    JournalHeader header;
    header.document = parts.next();
    header.scene = parts.next();
    header.handles = parts.next();
    header.handles_path = parts.next();
    header.model_bytes = parts.number<std::uint64_t>();
    header.model_checksum = parts.number<std::uint32_t>();
    return header;
}

} // namespace cellwarp::core
