// SPDX-License-Identifier: GPL-3.0-or-later
// A process with streams and an exit code.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace cellwarp::core::support
{

struct Result
{
    int code = -1; ///< exit code, or 128 + the signal that ended it
    std::string out, err;
};

/// Actions of a child before it becomes the program: close a stream, set a limit.
using InChild = std::function<void()>;

/// Runs a program to its end; no shell comes between.
Result run_program(const std::string& program, const std::vector<std::string>& arguments,
                   const InChild& in_child = {});

/// Starts a program without streams, to be waited for or killed.
pid_t start_program(const std::string& program,
                    const std::vector<std::string>& arguments);

/// Waits for a started program; its code as in Result.
int wait_for(pid_t process);

/// Waits until the process has its handler for a signal.
void wait_until_caught(pid_t process, int signal);

} // namespace cellwarp::core::support
