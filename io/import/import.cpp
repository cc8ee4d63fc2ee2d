// SPDX-License-Identifier: GPL-3.0-or-later
// The library runs in a program of its own, see main.cpp: of it only the list of formats
// is asked for here.
#include "io/import/import.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <assimp/Importer.hpp>

#include "io/base/descriptor.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/program.h"
#include "io/base/text.h"
#include "io/import/imported.h"

namespace cellwarp::core
{

namespace
{

/// The same file above the three streams, so that it can be put in the place of one.
Descriptor above_streams(Descriptor file)
{
    return Descriptor(file ? ::fcntl(file.get(), F_DUPFD_CLOEXEC, 3) : -1);
}

constexpr char kCannotStart[] = "cannot start the importer";

[[noreturn]] void fail(const std::string& path, const std::string& what, int error)
{
    throw Error(Fault::File, at({path, 0, ""}, what + ": " + std::strerror(error)));
}

/// A file of memory that holds \p bytes, from its beginning on; none and errno where
/// that fails.
Descriptor memory_file(const std::string& bytes)
{
    Descriptor file(::memfd_create("model", MFD_CLOEXEC));
    if (file && !write_at(file.get(), 0, bytes))
        return {};
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

/// All that comes out of \p pipe until it is closed; 0 or an errno.
int read_all(int pipe, std::string& bytes)
{
    char part[65536];
    std::int64_t got = 0;
    while ((got = read_next(pipe, part, sizeof part)) > 0)
        bytes.append(part, static_cast<std::size_t>(got));
    return got < 0 ? errno : 0;
}

/// What the importer says of the file; how it ended in \p status.
std::string answer(const std::string& path, const std::string& bytes, int& status)
{
    const std::string program = program_beside(kImporter);
    const Descriptor input = above_streams(memory_file(bytes));
    if (!input)
        fail(path, kCannotStart, errno);
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
        fail(path, kCannotStart, errno);
    Descriptor out = above_streams(Descriptor(ends[0]));
    Descriptor in = above_streams(Descriptor(ends[1]));
    if (!out || !in)
        fail(path, kCannotStart, errno);
    pid_t process = -1;
    if (const int failure =
            start(program, extension_of(path), input.get(), in.get(), process))
        fail(path, kCannotStart + (": " + program), failure);
    in.close();
    std::string result;
    const int failure = read_all(out.get(), result);
    out.close(); // an importer that still writes ends
    while (::waitpid(process, &status, 0) < 0 && errno == EINTR)
        ;
    if (failure != 0)
        fail(path, "cannot hear the importer", failure);
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
    out.face_ends.append(found.face_ends.begin(), found.face_ends.end());
    if (!out.directions.empty())
        out.attributes.push_back("normals");
    out.not_writable = "a ." + out.format + " can only be read";
    out.warnings.push_back(
        at({path, 0, ""}, "imported: coordinates are 32-bit floats, vertices may be "
                          "split and reordered, and only samples, faces and normals are "
                          "kept"));
    return out;
}

} // namespace cellwarp::core
