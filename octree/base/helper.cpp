// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/helper.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <system_error>
#include <utility>

#include <dlfcn.h>
#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

[[noreturn]] void fail(int error, const std::string& what)
{
    if (error == ENOMEM)
        throw std::bad_alloc();
    throw std::system_error(error, std::generic_category(), what);
}

/// The folder of the shared library that this code is in; empty: it is in a program.
fs::path library_folder()
{
    Dl_info info;
    if (::dladdr(reinterpret_cast<const void*>(&library_folder), &info) == 0 ||
        !info.dli_fname || *info.dli_fname != '/') // a program may have any name
        return {};
    std::error_code error;
    const fs::path file = fs::canonical(info.dli_fname, error);
    return error || file == fs::read_symlink("/proc/self/exe", error)
               ? fs::path()
               : file.parent_path();
}

std::vector<std::string> helper_folders()
{
    const char* const named = std::getenv("CELLWARP_HELPERS");
    if (named && *named)
        return {named};
    const fs::path self = program_folder();
    std::vector<std::string> folders;
    if (!self.empty())
        folders.push_back(self.string());
    if (const fs::path library = library_folder(); !library.empty())
        for (const char* const place : {"", CELLWARP_HELPERS_FROM_LIBRARY})
            folders.push_back((library / place).lexically_normal().string());
    // Relative ones are seen from the program.
    for (const char* const place : {CELLWARP_HELPER_PLACES})
    {
        const std::string folder = (self / place).lexically_normal().string();
        if (folder.starts_with('/') &&
            std::find(folders.begin(), folders.end(), folder) == folders.end())
            folders.push_back(folder);
    }
    return folders;
}

std::string helper_path(const std::string& name)
{
    std::string looked_at;
    for (const std::string& folder : helper_folders())
    {
        const std::string path = folder + "/" + name;
        if (::access(path.c_str(), X_OK) == 0)
            return path;
        looked_at += (looked_at.empty() ? "" : ", ") + folder;
    }
    fail(ENOENT, "cannot start " + name + ", looked for in " + looked_at +
                     " (the environment variable CELLWARP_HELPERS names its folder)");
}

/// An open file of the system, closed when it goes. Above the three streams, so that it
/// can be put in the place of one.
class File
{
public:
    explicit File(int file) : file_(file < 0 ? -1 : ::fcntl(file, F_DUPFD_CLOEXEC, 3))
    {
        const int error = errno;
        if (file >= 0)
            ::close(file);
        errno = error;
    }
    File(const File&) = delete;
    File& operator=(const File&) = delete;
    ~File() { close(); }
    int get() const { return file_; }
    void close()
    {
        if (file_ >= 0)
            ::close(std::exchange(file_, -1));
    }

private:
    int file_;
};

bool write_all(int file, std::string_view bytes)
{
    for (std::size_t at = 0; at < bytes.size();)
    {
        const ssize_t count =
            ::pwrite(file, bytes.data() + at, bytes.size() - at, static_cast<off_t>(at));
        if (count < 0 && errno != EINTR)
            return false;
        at += count > 0 ? static_cast<std::size_t>(count) : 0;
    }
    return true;
}

/// All that comes until it is closed; 0 or an errno.
int read_all(int file, std::string& bytes)
try
{
    char part[65536];
    for (;;)
    {
        const ssize_t count = ::read(file, part, sizeof part);
        if (count < 0 && errno == EINTR)
            continue;
        if (count <= 0)
            return count < 0 ? errno : 0;
        bytes.append(part, static_cast<std::size_t>(count));
    }
}
catch (const std::bad_alloc&)
{
    return ENOMEM;
}

/// Starts a program with these streams; 0 or an errno.
int start(const std::string& program, std::vector<std::string> words, int in, int out,
          pid_t& process)
{
    posix_spawn_file_actions_t streams;
    posix_spawnattr_t attributes;
    ::posix_spawn_file_actions_init(&streams);
    ::posix_spawn_file_actions_adddup2(&streams, in, 0);
    ::posix_spawn_file_actions_adddup2(&streams, out, 1);
    ::posix_spawnattr_init(&attributes);
    sigset_t all, none;
    ::sigfillset(&all);
    ::sigemptyset(&none);
    ::posix_spawnattr_setsigdefault(&attributes, &all);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setflags(&attributes,
                               POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK);
    words.insert(words.begin(), program);
    std::vector<char*> argv;
    for (std::string& word : words)
        argv.push_back(word.data());
    argv.push_back(nullptr);
    // Nothing else of the caller's surroundings, so that they change no result.
    constexpr char kLibraries[] = "LD_LIBRARY_PATH";
    const char* const folders = std::getenv(kLibraries);
    std::string libraries = std::string(kLibraries) + "=" + (folders ? folders : "");
    char* environment[] = {folders ? libraries.data() : nullptr, nullptr};
    const int failure = ::posix_spawn(&process, program.c_str(), &streams, &attributes,
                                      argv.data(), environment);
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&streams);
    return failure;
}

} // namespace

std::string program_folder()
{
    std::error_code error;
    return fs::read_symlink("/proc/self/exe", error).parent_path().string();
}

HelperEnd run_helper(const std::string& name, const std::vector<std::string>& arguments,
                     std::string_view input)
{
    const std::string program = helper_path(name),
                      cannot_start = "cannot start " + program;
    const File in(::memfd_create(name.c_str(), MFD_CLOEXEC));
    if (in.get() < 0 || !write_all(in.get(), input))
        fail(errno, cannot_start);
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
        fail(errno, cannot_start);
    File from(ends[0]), to(ends[1]);
    if (from.get() < 0 || to.get() < 0)
        fail(errno, cannot_start);
    pid_t process = -1;
    if (const int failure = start(program, arguments, in.get(), to.get(), process))
        fail(failure, cannot_start);
    to.close();
    HelperEnd end;
    const int failure = read_all(from.get(), end.out);
    from.close(); // a helper that still writes ends
    int status = 0;
    while (::waitpid(process, &status, 0) < 0 && errno == EINTR)
        ;
    if (failure != 0)
        fail(failure, "cannot hear " + program);
    if (WIFEXITED(status))
        end.code = WEXITSTATUS(status);
    else
        end.signal = WTERMSIG(status);
    return end;
}

} // namespace cellwarp::core
