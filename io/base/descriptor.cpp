// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/descriptor.h"

#include <cerrno>

namespace cellwarp::core
{

namespace
{

/// Calls put(bytes left) until there are none.
template <class Put>
bool put_all(std::string_view bytes, Put&& put)
{
    while (!bytes.empty())
    {
        const ssize_t done = put(bytes);
        if (done < 0 && errno == EINTR)
            continue;
        if (done < 0)
            return false;
        bytes.remove_prefix(static_cast<std::size_t>(done));
    }
    return true;
}

/// Calls get(bytes filled) until there is nothing more or it is enough.
template <class Get>
std::int64_t get_all(std::size_t count, Get&& get)
{
    std::size_t filled = 0;
    while (filled < count)
    {
        const ssize_t got = get(filled);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return -1;
        if (got == 0)
            break;
        filled += static_cast<std::size_t>(got);
    }
    return static_cast<std::int64_t>(filled);
}

} // namespace

bool write_all(int file, std::string_view bytes)
{
    return put_all(bytes, [file](std::string_view left)
                   { return ::write(file, left.data(), left.size()); });
}

bool write_at(int file, std::uint64_t start, std::string_view bytes)
{
    return put_all(bytes,
                   [&](std::string_view left)
                   {
                       return ::pwrite(
                           file, left.data(), left.size(),
                           static_cast<off_t>(start + (bytes.size() - left.size())));
                   });
}

std::int64_t read_at(int file, std::uint64_t start, char* bytes, std::size_t count)
{
    return get_all(count,
                   [&](std::size_t filled)
                   {
                       return ::pread(file, bytes + filled, count - filled,
                                      static_cast<off_t>(start + filled));
                   });
}

std::int64_t read_next(int file, char* bytes, std::size_t count)
{
    return get_all(count, [&](std::size_t filled)
                   { return ::read(file, bytes + filled, count - filled); });
}

} // namespace cellwarp::core
