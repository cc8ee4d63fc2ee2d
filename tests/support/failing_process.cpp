// SPDX-License-Identifier: GPL-3.0-or-later
// A process of which one call fails, in libraries too: a library to be loaded before all
// others (LD_PRELOAD). The calls are those below. CELLWARP_FAILS names the kind of call
// and which one of it, "write 3"; CELLWARP_FAILS_FROM a file: calls are counted once it
// is opened (none: from the beginning); CELLWARP_FAILS_TOLD a file that is made when the
// call fails.
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

namespace
{

std::atomic<long> calls{0};
std::atomic<bool> is_counting{false};

/// Whether this call of that kind is the one that fails.
bool fails(const char* kind, int error)
{
    const char* const wanted = std::getenv("CELLWARP_FAILS");
    if (wanted == nullptr || (!is_counting && std::getenv("CELLWARP_FAILS_FROM")))
        return false;
    const std::size_t length = std::strlen(kind);
    if (std::strncmp(wanted, kind, length) != 0 || wanted[length] != ' ')
        return false;
    if (++calls != std::atol(wanted + length))
        return false;
    if (const char* const told = std::getenv("CELLWARP_FAILS_TOLD"))
        ::syscall(SYS_close,
                  ::syscall(SYS_openat, AT_FDCWD, told, O_CREAT | O_WRONLY, 0600));
    errno = error;
    return true;
}

template <class Function>
Function* next(const char* name)
{
    return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

} // namespace

extern "C"
{
    void* __libc_malloc(std::size_t);
    void* __libc_calloc(std::size_t, std::size_t);
    void* __libc_realloc(void*, std::size_t);
    void* __libc_memalign(std::size_t, std::size_t);

    void* malloc(std::size_t bytes)
    {
        return fails("malloc", ENOMEM) ? nullptr : __libc_malloc(bytes);
    }
    void* calloc(std::size_t count, std::size_t bytes)
    {
        return fails("malloc", ENOMEM) ? nullptr : __libc_calloc(count, bytes);
    }
    void* realloc(void* old, std::size_t bytes)
    {
        return fails("malloc", ENOMEM) ? nullptr : __libc_realloc(old, bytes);
    }
    void* aligned_alloc(std::size_t alignment, std::size_t bytes)
    {
        return fails("malloc", ENOMEM) ? nullptr : __libc_memalign(alignment, bytes);
    }
    int posix_memalign(void** out, std::size_t alignment, std::size_t bytes)
    {
        *out = fails("malloc", ENOMEM) ? nullptr : __libc_memalign(alignment, bytes);
        return *out == nullptr ? ENOMEM : 0;
    }

    int open(const char* path, int flags, ...)
    {
        va_list rest;
        va_start(rest, flags);
        const mode_t mode =
            (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : mode_t(0);
        va_end(rest);
        const char* const from = std::getenv("CELLWARP_FAILS_FROM");
        if (from != nullptr && std::strcmp(path, from) == 0)
            is_counting = true;
        return fails("open", EMFILE)
                   ? -1
                   : static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
    }
    ssize_t write(int file, const void* bytes, std::size_t count)
    {
        return fails("write", ENOSPC) ? -1 : ::syscall(SYS_write, file, bytes, count);
    }
    int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                       void* (*start)(void*), void* argument)
    {
        static const auto real =
            next<int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*)>(
                "pthread_create");
        return fails("thread", EAGAIN) ? EAGAIN
                                       : real(thread, attributes, start, argument);
    }
    int fsync(int file)
    {
        return fails("fsync", EIO) ? -1 : static_cast<int>(::syscall(SYS_fsync, file));
    }
    int rename(const char* from, const char* to)
    {
        static const auto real = next<int(const char*, const char*)>("rename");
        return fails("rename", EACCES) ? -1 : real(from, to);
    }
    int renameat2(int from_folder, const char* from, int to_folder, const char* to,
                  unsigned flags)
    {
        return fails("rename", EACCES)
                   ? -1
                   : static_cast<int>(::syscall(SYS_renameat2, from_folder, from,
                                                to_folder, to, flags));
    }
}
