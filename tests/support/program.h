// SPDX-License-Identifier: GPL-3.0-or-later
// The program as scripts see it: a process with streams and an exit code.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

struct Result
{
    int code = -1; ///< exit code, or 128 + the signal that ended it
    std::string out, err;
};

/// What a child does before it becomes the program: close a stream, set a limit.
using InChild = std::function<void()>;

/// Runs the program to its end; no shell comes between.
Result run(const std::vector<std::string>& arguments, const InChild& in_child = {});

/// The same for another program, or a copy of it.
Result run_program(const std::string& program, const std::vector<std::string>& arguments,
                   const InChild& in_child = {});

/// Whether this build of the program has a command.
bool has_command(const std::string& name);

/// Starts the program without streams, to be waited for or killed.
pid_t start(const std::vector<std::string>& arguments);

/// Waits for a started program; its code as in Result.
int wait_for(pid_t process);

/// Waits until the process has its handler for a signal.
void wait_until_caught(pid_t process, int signal);

/// Number of entries in a folder, hidden ones too.
std::size_t num_files(const Folder& folder);

/// A small bar with a handle file of two frames, in a folder of its own.
struct BarFiles
{
    Folder folder;
    std::string model, handles, out;

    BarFiles();
    /// The arguments of its deform, 12 cells across unless \p across says otherwise.
    std::vector<std::string> deform_arguments(const std::vector<std::string>& more = {},
                                              const std::string& across = "12") const;
    Result deform(const std::vector<std::string>& more = {},
                  const InChild& in_child = {}) const
    {
        return run(deform_arguments(more), in_child);
    }
};

} // namespace cellwarp::core::support
