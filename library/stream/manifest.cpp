// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/stream/manifest.h"

#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

/// First bytes of every manifest.
constexpr std::string_view kMark = "#cellwarp-manifest 1\t";
constexpr std::string_view kHead =
    "#cellwarp-manifest 1\tstatus\tsamples\tseconds\toutput_bytes\tinput_bytes\t"
    "input_time\tfield\tmessage\n";
constexpr std::size_t kColumns = 9;

/// Tabs and line ends inside a column would end it.
std::string escaped(std::string_view text)
{
    std::string out;
    for (const char c : text)
        out += c == '\t'   ? "\\t"
               : c == '\n' ? "\\n"
               : c == '\r' ? "\\r"
               : c == '\\' ? "\\\\"
                           : std::string(1, c);
    return out;
}

std::string unescaped(std::string_view text)
{
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i)
    {
        const bool is_escape = text[i] == '\\' && i + 1 < text.size();
        const char c = is_escape ? text[++i] : text[i];
        out += !is_escape ? c : c == 't' ? '\t' : c == 'n' ? '\n' : c == 'r' ? '\r' : c;
    }
    return out;
}

/// Nothing if it is no line of a manifest.
std::optional<ManifestLine> parse(std::string_view text)
{
    std::vector<std::string_view> columns;
    for (std::size_t first = 0; first <= text.size();)
    {
        const std::size_t end = std::min(text.find('\t', first), text.size());
        columns.push_back(text.substr(first, end - first));
        first = end + 1;
    }
    if (columns.size() != kColumns || text.starts_with('#'))
        return std::nullopt;
    const std::optional<std::int64_t> samples = parse_integer(columns[2]),
                                      output = parse_integer(columns[4]),
                                      input = parse_integer(columns[5]),
                                      time = parse_integer(columns[6]);
    const std::optional<double> seconds = parse_double(columns[3]);
    if (!samples || !output || !input || !time || !seconds)
        return std::nullopt;
    return ManifestLine{
        unescaped(columns[0]),
        std::string(columns[1]),
        static_cast<std::uint64_t>(*samples),
        *seconds,
        static_cast<std::uint64_t>(*output),
        {static_cast<std::uint64_t>(*input), *time, std::string(columns[7])},
        unescaped(columns[8])};
}

/// The error of the last call of the system.
Error manifest_error(const std::string& path, const std::string& doing)
{
    return Error(Fault::File,
                 at({path, 0, ""}, "cannot " + doing + ": " + std::strerror(errno)));
}

/// The error for a file that is no manifest.
Error refused(const std::string& path, const std::string& what)
{
    return Error(Fault::File, at({path, 0, ""}, what + ": it is no manifest of cellwarp, "
                                                       "will not write into it"));
}

/// The first bytes of a file: \p size, or all where it is shorter.
std::string beginning(const std::string& path, int file, std::uint64_t size)
{
    std::string text(static_cast<std::size_t>(size), '\0');
    const std::int64_t got = read_at(file, 0, text.data(), text.size());
    if (got < 0)
        throw manifest_error(path, "read");
    text.resize(static_cast<std::size_t>(got));
    return text;
}

/// The text of a manifest; it may end within its first line. Throws Fault::File for any
/// other file, whose first bytes alone are read.
std::string manifest_text(const std::string& path, int file)
{
    struct stat status
    {
    };
    if (::fstat(file, &status) != 0)
        throw manifest_error(path, "read");
    if (!S_ISREG(status.st_mode))
        throw refused(path, "is no regular file");
    const std::uint64_t size = static_cast<std::uint64_t>(status.st_size);
    const std::string mark = beginning(path, file, kMark.size());
    const bool is_torn = size < kMark.size() && kMark.starts_with(mark);
    if (mark != kMark && !is_torn)
        throw refused(path, "does not begin with #cellwarp-manifest 1 and a tab");
    if (size > kMaxFileBytes)
        throw Error(Fault::File, at({path, 0, ""}, "is larger than 4 GiB"));
    return beginning(path, file, size);
}

} // namespace

InputMark mark_of(const std::string& input, const std::string& field_checksum)
{
    struct stat status
    {
    };
    if (::stat(input.c_str(), &status) != 0)
        return {0, 0, field_checksum};
    constexpr std::int64_t kNanoseconds = 1000000000;
    return {static_cast<std::uint64_t>(status.st_size),
            status.st_mtim.tv_sec * kNanoseconds + status.st_mtim.tv_nsec,
            field_checksum};
}

Manifest::Manifest(const std::string& path) : path_(path)
{
    // No link is followed, and nothing is written before the file is known for ours: in a
    // folder of many people the name may lead to a file of somebody else.
    file_ = Descriptor(
        ::open(path.c_str(),
               O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666));
    if (!file_)
    {
        if (errno == ELOOP)
            throw refused(path, "is a symbolic link");
        throw manifest_error(path, "write");
    }
    const std::string old = manifest_text(path, file_.get());
    const std::size_t whole = old.rfind('\n') + 1;
    for (std::size_t first = 0; first < whole;)
    {
        const std::size_t end = old.find('\n', first);
        if (const std::optional<ManifestLine> line =
                parse(std::string_view(old).substr(first, end - first)))
            lines_[line->input] = *line;
        first = end + 1;
    }
    if (whole < old.size() && ::ftruncate(file_.get(), static_cast<off_t>(whole)) != 0)
        throw manifest_error(path, "write");
    if (whole == 0 && ::write(file_.get(), kHead.data(), kHead.size()) !=
                          static_cast<ssize_t>(kHead.size()))
        throw manifest_error(path, "write");
}

const ManifestLine* Manifest::find(const std::string& input) const
{
    const auto found = lines_.find(input);
    return found == lines_.end() ? nullptr : &found->second;
}

void Manifest::add(const ManifestLine& line)
{
    const std::string text = fmt::format(
        "{}\t{}\t{}\t{:.6f}\t{}\t{}\t{}\t{}\t{}\n", escaped(line.input), line.status,
        line.samples, line.seconds, line.output_bytes, line.mark.bytes, line.mark.time,
        line.mark.field, escaped(line.message));
    const std::lock_guard lock(mutex_);
    // One call a line: what a kill tears is the last line at the most.
    if (::write(file_.get(), text.data(), text.size()) !=
            static_cast<ssize_t>(text.size()) ||
        ::fdatasync(file_.get()) != 0)
        throw manifest_error(path_, "write");
}

} // namespace cellwarp::core
