// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/process.h"

#include <fstream>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "tests/support/files.h"

namespace cellwarp::core::support
{

namespace
{

[[noreturn]] void become(const std::string& program,
                         const std::vector<std::string>& arguments)
{
    std::vector<char*> argv = {const_cast<char*>(program.c_str())};
    for (const std::string& argument : arguments)
        argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    ::execv(argv[0], argv.data());
    ::_exit(99);
}

} // namespace

Result run_program(const std::string& program, const std::vector<std::string>& arguments,
                   const InChild& in_child)
{
    const Folder folder;
    const std::string out = folder / "out", err = folder / "err";
    const pid_t child = ::fork();
    if (child == 0)
    {
        ::dup2(::open(out.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600), 1);
        ::dup2(::open(err.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600), 2);
        if (in_child)
            in_child();
        become(program, arguments);
    }
    const int code = wait_for(child);
    return {code, bytes_of(out), bytes_of(err)};
}

pid_t start_program(const std::string& program, const std::vector<std::string>& arguments)
{
    const pid_t child = ::fork();
    if (child == 0)
    {
        const int nowhere = ::open("/dev/null", O_RDWR);
        ::dup2(nowhere, 1);
        ::dup2(nowhere, 2);
        become(program, arguments);
    }
    return child;
}

int wait_for(pid_t process)
{
    int status = 0;
    ::waitpid(process, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

void wait_until_caught(pid_t process, int signal)
{
    for (int tries = 0; tries < 1000; ++tries)
    {
        std::ifstream status("/proc/" + std::to_string(process) + "/status");
        for (std::string line; std::getline(status, line);)
            if (line.starts_with("SigCgt:") &&
                (std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1))
                return;
        ::usleep(10000);
    }
    ADD_FAILURE() << "the process has no handler for signal " << signal;
}

} // namespace cellwarp::core::support
