// SPDX-License-Identifier: GPL-3.0-or-later
// A display of its own for a test: Xvfb, which draws in memory.
#pragma once

#include <string>

#include <sys/types.h>

namespace cellwarp::core::support
{

class Display
{
public:
    /// Starts one, if Xvfb is installed.
    Display();
    ~Display();
    Display(const Display&) = delete;
    Display& operator=(const Display&) = delete;

    /// ":N"; empty: there is none.
    const std::string& name() const { return name_; }

private:
    std::string name_;
    pid_t server_ = -1;
};

/// The path of a program of this machine; empty: it is not installed.
std::string installed(const std::string& program);

} // namespace cellwarp::core::support
