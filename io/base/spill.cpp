// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/spill.h"

#include <cerrno>
#include <cstring>

#include <unistd.h>

#include "io/base/bytes.h"
#include "io/base/error.h"

namespace cellwarp::core
{

namespace
{

[[noreturn]] void fail(const std::string& doing)
{
    throw Error(Fault::File, "a temporary file: " + doing + ": " + std::strerror(errno));
}

} // namespace

SpillFile::SpillFile(const std::string& folder) : file_(open_unnamed(folder)) {}

void SpillFile::append(const void* bytes, std::size_t count)
{
    overwrite(size_, bytes, count);
    size_ += count;
}

void SpillFile::overwrite(std::uint64_t start, const void* bytes, std::size_t count) const
{
    if (!write_at(file_.get(), start, {static_cast<const char*>(bytes), count}))
        fail("cannot write");
}

void SpillFile::read(std::uint64_t start, void* bytes, std::size_t count) const
{
    const std::int64_t got =
        read_at(file_.get(), start, static_cast<char*>(bytes), count);
    if (got < 0 || static_cast<std::size_t>(got) < count)
        fail("cannot read");
}

} // namespace cellwarp::core
