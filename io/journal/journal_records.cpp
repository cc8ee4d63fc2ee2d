// SPDX-License-Identifier: GPL-3.0-or-later
// The end of the program, and a disk that loses its power, cut a file: the last record is
// shorter than its length, or blocks at the file's end were never written and read as
// zeros. All else that does not fit its checksum was altered, the last record too.
#include "io/journal/journal_records.h"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <optional>

#include "io/base/checksum.h"
#include "io/base/descriptor.h"
#include "io/base/error.h"

namespace cellwarp::core
{

namespace
{

/// Disks write whole blocks of this size [bytes], or of a multiple.
constexpr std::uint64_t kBlock = 512;

/// Read at once while a file is checked [bytes].
constexpr std::size_t kWindow = std::size_t(1) << 18;

/// Bytes of a file, a window of them in memory.
class Window
{
public:
    Window(const std::string& path, int file, std::uint64_t size)
        : path_(path), file_(file), size_(size)
    {
    }

    /// From \p start on: \p count bytes, at most kWindow and inside the file.
    std::string_view bytes(std::uint64_t start, std::size_t count)
    {
        if (start < start_ || start + count > start_ + buffer_.size())
        {
            start_ = start;
            buffer_.resize(static_cast<std::size_t>(
                std::min<std::uint64_t>(kWindow, size_ - start)));
            const std::int64_t got =
                read_at(file_, start, buffer_.data(), buffer_.size());
            if (got < 0)
                throw Error(Fault::File, at({path_, 0, ""}, std::string("cannot read: ") +
                                                                std::strerror(errno)));
            if (static_cast<std::size_t>(got) < buffer_.size())
                throw Error(Fault::File, at({path_, 0, ""}, "changed while it was read"));
        }
        return std::string_view(buffer_).substr(static_cast<std::size_t>(start - start_),
                                                count);
    }

private:
    const std::string& path_;
    int file_;
    std::uint64_t size_, start_ = 0;
    std::string buffer_;
};

/// Finds the whole records of a file, and what is wrong behind them.
class RecordCheck
{
public:
    RecordCheck(const std::string& path, int file, std::uint64_t size)
        : size_(size), window_(path, file, size), search_(path, file, size)
    {
    }

    /// Where the record ends that starts there; nothing if no whole one does.
    std::optional<std::uint64_t> end_of(std::uint64_t start, std::uint64_t number)
    {
        if (size_ - start < sizeof(RecordHead))
            return std::nullopt;
        const RecordHead head = head_at(start);
        if (head.number != number || head.length > kMaxPayload ||
            head.length > size_ - start - sizeof head || !fits(start, head.length, head))
            return std::nullopt;
        return start + sizeof head + head.length;
    }

    /// Of what starts there and is no whole record: the file was cut, not altered.
    bool is_cut(std::uint64_t start, std::uint64_t number)
    {
        const std::uint64_t rest = size_ - start;
        if (rest < sizeof(RecordHead))
            return true;
        const RecordHead head = head_at(start);
        const std::uint64_t end = start + sizeof head + head.length;
        // Too short for its length: cut, unless it is the length that was altered.
        if (end > size_)
            return !(rest - sizeof head <= kMaxPayload &&
                     fits(start, static_cast<std::uint32_t>(rest - sizeof head), head)) &&
                   !is_followed(start, number);
        const std::uint64_t zeros = zeros_from(start);
        return zeros == start || (zeros <= (size_ - 1) / kBlock * kBlock && end > zeros);
    }

private:
    RecordHead head_at(std::uint64_t start)
    {
        RecordHead head{};
        std::memcpy(&head, window_.bytes(start, sizeof head).data(), sizeof head);
        return head;
    }

    /// With \p length instead of what the head says.
    bool fits(std::uint64_t start, std::uint32_t length, const RecordHead& head)
    {
        std::uint32_t checksum = checksum_of_head(length, head.number);
        const std::uint64_t end = start + sizeof head + length;
        for (std::uint64_t p = start + sizeof head; p < end;)
        {
            const std::size_t count =
                static_cast<std::size_t>(std::min<std::uint64_t>(kWindow, end - p));
            checksum = checksum_of(window_.bytes(p, count), checksum);
            p += count;
        }
        return checksum == head.checksum;
    }

    /// Whether the next record is somewhere behind. Its number is found first, which
    /// hardly anything else looks like; where too much does, the file is no cut one.
    bool is_followed(std::uint64_t start, std::uint64_t number)
    {
        const std::uint64_t next = number + 1;
        constexpr std::size_t kBefore = offsetof(RecordHead, number);
        std::uint64_t effort = 16 * (size_ - start);
        std::uint64_t p = start + sizeof(RecordHead) + kBefore;
        while (p + sizeof next <= size_)
        {
            const std::string_view bytes = search_.bytes(
                p, static_cast<std::size_t>(std::min<std::uint64_t>(kWindow, size_ - p)));
            for (std::size_t found = bytes.find(bytes_of(next));
                 found != std::string_view::npos;
                 found = bytes.find(bytes_of(next), found + 1))
            {
                const std::uint64_t candidate = p + found - kBefore;
                if (end_of(candidate, next))
                    return true;
                const std::uint64_t length = head_at(candidate).length;
                if (length > size_ - candidate)
                    continue;
                if (length > effort)
                    return true;
                effort -= length;
            }
            p += bytes.size() - sizeof next + 1;
        }
        return false;
    }

    /// Where the zeros begin that the file ends in; not before \p start.
    std::uint64_t zeros_from(std::uint64_t start)
    {
        std::uint64_t end = size_;
        while (end > start)
        {
            const std::uint64_t begin =
                end - std::min<std::uint64_t>(end - start, kWindow);
            const std::string_view bytes =
                search_.bytes(begin, static_cast<std::size_t>(end - begin));
            const std::size_t last = bytes.find_last_not_of('\0');
            if (last != std::string_view::npos)
                return begin + last + 1;
            end = begin;
        }
        return start;
    }

    std::uint64_t size_;
    Window window_, search_;
};

} // namespace

std::uint32_t checksum_of_head(std::uint32_t length, std::uint64_t number)
{
    return checksum_of(bytes_of(number), checksum_of(bytes_of(length)));
}

WholeRecords whole_records(const std::string& path, int file, std::uint64_t first,
                           std::uint64_t size)
{
    WholeRecords records;
    records.end = first;
    RecordCheck check(path, file, size);
    while (records.end < size)
    {
        const std::uint64_t number = records.starts.size() + 1;
        const std::optional<std::uint64_t> end = check.end_of(records.end, number);
        if (end)
        {
            records.starts.push_back(records.end);
            records.end = *end;
        }
        else if (check.is_cut(records.end, number))
            break;
        else
            throw malformed({path, 0,
                             "record " + std::to_string(number) + " (byte " +
                                 std::to_string(records.end) + ")"},
                            "was altered: it does not fit its checksum");
    }
    return records;
}

} // namespace cellwarp::core
