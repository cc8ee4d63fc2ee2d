// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/program.h"

#include <filesystem>
#include <fstream>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "octree/base/index.h"

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

Result run(const std::vector<std::string>& arguments, const InChild& in_child)
{
    return run_program(CELLWARP_BINARY, arguments, in_child);
}

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

bool has_command(const std::string& name)
{
    return run({"help", name}).code == 0;
}

pid_t start(const std::vector<std::string>& arguments)
{
    const pid_t child = ::fork();
    if (child == 0)
    {
        const int nowhere = ::open("/dev/null", O_RDWR);
        ::dup2(nowhere, 1);
        ::dup2(nowhere, 2);
        become(CELLWARP_BINARY, arguments);
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

std::size_t num_files(const Folder& folder)
{
    return idx(std::distance(std::filesystem::directory_iterator(folder.path()), {}));
}

BarFiles::BarFiles()
{
    model =
        folder.write("bar.obj", obj_text(box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 4)));
    handles = folder.write("bar.handles",
                           "cellwarp-handles 1\nfixed foot box -1 -1 -1 1 1 0.3\n"
                           "handle head box -1 -1 3.7 1 1 5\n"
                           "frame 1\nmove head rotate 0 0 1 30\n"
                           "frame 12\nmove head rotate 0 0 1 60\n");
    out = folder / "out.obj";
}

std::vector<std::string> BarFiles::deform_arguments(const std::vector<std::string>& more,
                                                    const std::string& across) const
{
    std::vector<std::string> arguments = {"deform", model, "--handles", handles,
                                          "-o",     out,   "--across",  across};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
}

} // namespace cellwarp::core::support
