// SPDX-License-Identifier: GPL-3.0-or-later
// The library runs in a program of its own: skeleton_main.cpp tells why.
#include "octree/wrap/skeleton.h"

#include <array>
#include <cerrno>
#include <filesystem>
#include <new>
#include <system_error>
#include <utility>

#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "octree/wrap/skeleton_bytes.h"

namespace cellwarp::core
{

namespace
{

constexpr char kProgram[] = "cellwarp-skeleton";

[[noreturn]] void fail(int error)
{
    throw std::system_error(error, std::generic_category(),
                            std::string("cannot start ") + kProgram);
}

/// A file of memory, closed at the end.
class MemoryFile
{
public:
    explicit MemoryFile(const char* name) : file_(::memfd_create(name, MFD_CLOEXEC))
    {
        if (file_ < 0)
            fail(errno);
    }
    ~MemoryFile() { ::close(file_); }
    MemoryFile(const MemoryFile&) = delete;
    MemoryFile& operator=(const MemoryFile&) = delete;
    int get() const { return file_; }
    void write(std::string_view bytes)
    {
        for (std::size_t at = 0; at < bytes.size();)
        {
            const ssize_t count = ::pwrite(file_, bytes.data() + at, bytes.size() - at,
                                           static_cast<off_t>(at));
            if (count < 0 && errno != EINTR)
                fail(errno);
            at += count > 0 ? static_cast<std::size_t>(count) : 0;
        }
    }
    std::string read() const
    {
        std::string bytes;
        char part[65536];
        for (;;)
        {
            const ssize_t count =
                ::pread(file_, part, sizeof part, static_cast<off_t>(bytes.size()));
            if (count < 0 && errno == EINTR)
                continue;
            if (count <= 0)
                return bytes;
            bytes.append(part, static_cast<std::size_t>(count));
        }
    }

private:
    int file_;
};

} // namespace

bool has_curve_skeleton()
{
    return true;
}

CurveSkeleton curve_skeleton(const Shape& surface)
{
    std::error_code error;
    const std::filesystem::path self =
        std::filesystem::read_symlink("/proc/self/exe", error);
    if (error)
        fail(error.value());
    std::string program = (self.parent_path() / kProgram).string();
    MemoryFile in("surface"), out("skeleton");
    in.write(bytes_of(surface));
    posix_spawn_file_actions_t streams;
    int failure = ::posix_spawn_file_actions_init(&streams);
    for (const auto& [file, stream] : {std::pair(in.get(), 0), {out.get(), 1}})
        if (failure == 0)
            failure = ::posix_spawn_file_actions_adddup2(&streams, file, stream);
    const std::array<char*, 2> words = {program.data(), nullptr};
    pid_t process = -1;
    // Without the caller's surroundings, so that nothing of them changes what it does.
    char* no_surroundings[] = {nullptr};
    if (failure == 0)
        failure = ::posix_spawn(&process, program.c_str(), &streams, nullptr,
                                words.data(), no_surroundings);
    ::posix_spawn_file_actions_destroy(&streams);
    if (failure == ENOMEM)
        throw std::bad_alloc();
    if (failure != 0)
        fail(failure);
    int status = 0;
    while (::waitpid(process, &status, 0) < 0 && errno == EINTR)
        ;
    if (WIFEXITED(status) && WEXITSTATUS(status) == kSkeletonWithoutMemory)
        throw std::bad_alloc();
    CurveSkeleton skeleton;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 ||
        !read_bytes(out.read(), skeleton))
        return {}; // the library gave up
    return skeleton;
}

} // namespace cellwarp::core
