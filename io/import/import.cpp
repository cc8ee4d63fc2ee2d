// SPDX-License-Identifier: GPL-3.0-or-later
// The library runs in a program of its own, see main.cpp: of it only the list of formats
// is asked for here.
#include "io/import/import.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <assimp/Importer.hpp>

#include "io/error.h"
#include "io/import/imported.h"
#include "io/number.h"
#include "io/program.h"

namespace cellwarp
{

namespace
{

/// An open file above the three streams, so that it can be put in the place of one.
class Descriptor
{
public:
    explicit Descriptor(int file)
        : value_(file < 0 ? -1 : ::fcntl(file, F_DUPFD_CLOEXEC, 3))
    {
        if (file >= 0)
            ::close(file);
    }
    ~Descriptor() { close(); }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;

    int value() const { return value_; }
    void close()
    {
        if (value_ >= 0)
            ::close(std::exchange(value_, -1));
    }

private:
    int value_;
};

[[noreturn]] void fail(const std::string& path, const std::string& what)
{
    throw Error(Fault::File, at({path, 0, ""}, "cannot start the importer: " + what));
}

/// A file of memory that holds \p bytes, from its beginning on; -1 and errno: none.
int memory_file(const std::string& bytes)
{
    const int file = ::memfd_create("model", MFD_CLOEXEC);
    for (std::size_t done = 0; file >= 0 && done < bytes.size();)
    {
        const ssize_t wrote = ::pwrite(file, bytes.data() + done, bytes.size() - done,
                                       static_cast<off_t>(done));
        if (wrote < 0 && errno == EINTR)
            continue;
        if (wrote <= 0)
        {
            const int why = errno;
            ::close(file);
            errno = why;
            return -1;
        }
        done += static_cast<std::size_t>(wrote);
    }
    return file;
}

/// Starts the importer with these streams; 0 or an errno.
int start(const std::string& program, const std::string& extension, int in, int out,
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
    std::string name = program, kind = extension, starter = std::to_string(::getpid());
    const std::array<char*, 4> words = {name.data(), kind.data(), starter.data(),
                                        nullptr};
    const int failure = ::posix_spawn(&process, program.c_str(), &streams, &attributes,
                                      words.data(), environ);
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&streams);
    return failure;
}

/// All that comes out of \p pipe until it is closed.
std::string all_of(int pipe)
{
    std::string bytes;
    char part[65536];
    for (;;)
    {
        const ssize_t got = ::read(pipe, part, sizeof part);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return bytes;
        bytes.append(part, static_cast<std::size_t>(got));
    }
}

/// What the importer says of the file; how it ended in \p status.
std::string answer(const std::string& path, const std::string& bytes, int& status)
{
    const std::string program = program_beside(kImporter);
    const Descriptor input(memory_file(bytes));
    if (input.value() < 0)
        fail(path, std::strerror(errno));
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
        fail(path, std::strerror(errno));
    const Descriptor out(ends[0]);
    Descriptor in(ends[1]);
    pid_t process = -1;
    if (const int failure =
            start(program, extension_of(path), input.value(), in.value(), process))
        fail(path, program + ": " + std::strerror(failure));
    in.close();
    std::string result = all_of(out.value());
    while (::waitpid(process, &status, 0) < 0 && errno == EINTR)
        ;
    return result;
}

} // namespace

bool is_import_format(std::string_view extension)
{
    return !extension.empty() &&
           Assimp::Importer().IsExtensionSupported("." + std::string(extension));
}

Geometry import_geometry(const std::string& path, const std::string& bytes)
{
    if (bytes.empty())
        throw malformed({path, 0, ""}, "the file is empty: no vertices");
    int status = 0;
    const std::string result = answer(path, bytes, status);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
        throw malformed({path, 0, ""},
                        "cannot be imported: the importer " +
                            (WIFSIGNALED(status)
                                 ? "ended with signal " + std::to_string(WTERMSIG(status))
                                 : std::string("gave up")));
    Imported found;
    if (!parse_imported(result, found))
        throw malformed({path, 0, ""}, "cannot be imported: the importer ended early");
    if (!found.problem.empty())
        throw malformed({path, 0, ""}, found.problem);
    Geometry out;
    out.format = extension_of(path);
    out.samples = std::move(found.samples);
    out.directions = std::move(found.directions);
    out.direction_samples = std::move(found.direction_samples);
    out.corners = std::move(found.corners);
    out.face_ends = std::move(found.face_ends);
    if (!out.directions.empty())
        out.attributes.push_back("normals");
    out.not_writable = "a ." + out.format + " can only be read";
    out.warnings.push_back(
        at({path, 0, ""}, "imported: coordinates are 32-bit floats, vertices may be "
                          "split and reordered, and only samples, faces and normals are "
                          "kept"));
    return out;
}

} // namespace cellwarp
