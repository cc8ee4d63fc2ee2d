// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/failing_calls.h"

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <limits>

#include <fcntl.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/types.h>

namespace
{

std::atomic<int> calls{0}, first{0}, last{0}; ///< first 0: none fails
std::atomic<bool> has_rename_flags{true}, has_links{true};

bool fails()
{
    if (first == 0)
        return false;
    const int number = ++calls;
    if (number < first || number > last)
        return false;
    errno = EIO;
    return true;
}

} // namespace

// NOLINTBEGIN: the linker gives the names
#define CELLWARP_FAILING(result, name, parameters, arguments)                            \
    extern "C" result __real_##name parameters;                                          \
    extern "C" result __wrap_##name parameters                                           \
    {                                                                                    \
        return fails() ? -1 : __real_##name arguments;                                   \
    }

CELLWARP_FAILING(ssize_t, read, (int file, void* bytes, size_t count),
                 (file, bytes, count))
CELLWARP_FAILING(ssize_t, pread, (int file, void* bytes, size_t count, off_t start),
                 (file, bytes, count, start))
CELLWARP_FAILING(ssize_t, write, (int file, const void* bytes, size_t count),
                 (file, bytes, count))
CELLWARP_FAILING(ssize_t, pwrite,
                 (int file, const void* bytes, size_t count, off_t start),
                 (file, bytes, count, start))
CELLWARP_FAILING(int, fsync, (int file), (file))
CELLWARP_FAILING(int, fdatasync, (int file), (file))
CELLWARP_FAILING(int, ftruncate, (int file, off_t size), (file, size))
CELLWARP_FAILING(int, rename, (const char* from, const char* to), (from, to))
CELLWARP_FAILING(int, unlink, (const char* path), (path))
CELLWARP_FAILING(int, fstat, (int file, struct stat* status), (file, status))
CELLWARP_FAILING(int, stat, (const char* path, struct stat* status), (path, status))
CELLWARP_FAILING(int, flock, (int file, int how), (file, how))
CELLWARP_FAILING(off_t, lseek, (int file, off_t place, int from), (file, place, from))
CELLWARP_FAILING(int, fchmod, (int file, mode_t mode), (file, mode))
CELLWARP_FAILING(int, mkostemp, (char* name, int flags), (name, flags))
CELLWARP_FAILING(int, memfd_create, (const char* name, unsigned flags), (name, flags))
CELLWARP_FAILING(int, pipe2, (int* ends, int flags), (ends, flags))
#undef CELLWARP_FAILING

extern "C" int __real_renameat2(int, const char*, int, const char*, unsigned);
extern "C" int __wrap_renameat2(int from_folder, const char* from, int to_folder,
                                const char* to, unsigned flags)
{
    if (!has_rename_flags)
    {
        errno = EINVAL;
        return -1;
    }
    return fails() ? -1 : __real_renameat2(from_folder, from, to_folder, to, flags);
}

extern "C" int __real_link(const char*, const char*);
extern "C" int __wrap_link(const char* from, const char* to)
{
    if (!has_links)
    {
        errno = EPERM;
        return -1;
    }
    return fails() ? -1 : __real_link(from, to);
}

extern "C" int __real_open(const char*, int, ...);
extern "C" int __wrap_open(const char* path, int flags, ...)
{
    va_list rest;
    va_start(rest, flags);
    const mode_t mode =
        (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : mode_t(0);
    va_end(rest);
    return fails() ? -1 : __real_open(path, flags, mode);
}

extern "C" int __real_fcntl(int, int, ...);
extern "C" int __wrap_fcntl(int file, int command, ...)
{
    va_list rest;
    va_start(rest, command);
    const long argument = va_arg(rest, long);
    va_end(rest);
    return fails() ? -1 : __real_fcntl(file, command, argument);
}

extern "C" int __real_posix_spawn(pid_t*, const char*, const posix_spawn_file_actions_t*,
                                  const posix_spawnattr_t*, char* const[], char* const[]);
extern "C" int __wrap_posix_spawn(pid_t* process, const char* path,
                                  const posix_spawn_file_actions_t* actions,
                                  const posix_spawnattr_t* attributes,
                                  char* const words[], char* const environment[])
{
    return fails() ? EIO
                   : __real_posix_spawn(process, path, actions, attributes, words,
                                        environment);
}
// NOLINTEND

namespace cellwarp::core::support
{

FailingCalls::FailingCalls(int number, How how)
{
    calls = 0;
    last = how == How::Once ? number : std::numeric_limits<int>::max();
    first = number;
}

FailingCalls::~FailingCalls()
{
    first = 0;
}

LackingCalls::LackingCalls(Lacks lacks)
{
    has_rename_flags = lacks == Lacks::Nothing;
    has_links = lacks != Lacks::SecondNames;
}

LackingCalls::~LackingCalls()
{
    has_rename_flags = has_links = true;
}

bool FailingCalls::was_reached()
{
    return calls >= first;
}

} // namespace cellwarp::core::support
