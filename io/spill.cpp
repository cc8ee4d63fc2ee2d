// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/spill.h"

#include <cerrno>
#include <cstring>

#include <unistd.h>

#include "io/bytes.h"
#include "io/error.h"

namespace cellwarp
{

namespace
{

[[noreturn]] void fail(const std::string& doing)
{
    throw Error(Fault::File, "a temporary file: " + doing + ": " + std::strerror(errno));
}

} // namespace

SpillFile::SpillFile(const std::string& folder) : file_(open_unnamed(folder)) {}

SpillFile::~SpillFile()
{
    if (file_ >= 0)
        ::close(file_);
}

void SpillFile::append(const void* bytes, std::size_t count)
{
    overwrite(size_, bytes, count);
    size_ += count;
}

void SpillFile::overwrite(std::uint64_t start, const void* bytes, std::size_t count) const
{
    const char* from = static_cast<const char*>(bytes);
    while (count > 0)
    {
        const ssize_t put = ::pwrite(file_, from, count, static_cast<off_t>(start));
        if (put < 0 && errno == EINTR)
            continue;
        if (put < 0)
            fail("cannot write");
        from += put;
        start += static_cast<std::uint64_t>(put);
        count -= static_cast<std::size_t>(put);
    }
}

void SpillFile::read(std::uint64_t start, void* bytes, std::size_t count) const
{
    char* to = static_cast<char*>(bytes);
    while (count > 0)
    {
        const ssize_t got = ::pread(file_, to, count, static_cast<off_t>(start));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            fail("cannot read");
        to += got;
        start += static_cast<std::uint64_t>(got);
        count -= static_cast<std::size_t>(got);
    }
}

} // namespace cellwarp
