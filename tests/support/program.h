// SPDX-License-Identifier: GPL-3.0-or-later
// The command line as scripts see it: a process with streams and an exit code.
#pragma once

#include <string>
#include <vector>

#include <sys/types.h>

#include "tests/support/files.h"
#include "tests/support/process.h"

namespace cellwarp::core::support
{

/// Runs the command line to its end.
Result run(const std::vector<std::string>& arguments, const InChild& in_child = {});

/// True if this build has the parts that a command needs: render pictures, skeleton CGAL.
bool can_run(const std::string& command);

/// Starts it without streams, to be waited for or killed.
pid_t start(const std::vector<std::string>& arguments);

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
