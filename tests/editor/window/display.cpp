// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/editor/window/display.h"

#include <cstdlib>
#include <filesystem>
#include <sstream>

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

namespace cellwarp::core::support
{

std::string installed(const std::string& program)
{
    const char* path = std::getenv("PATH");
    std::istringstream folders(path == nullptr ? "/usr/bin" : path);
    for (std::string folder; std::getline(folders, folder, ':');)
        if (::access((folder + "/" + program).c_str(), X_OK) == 0)
            return folder + "/" + program;
    return "";
}

Display::Display()
{
    const std::string server = installed("Xvfb");
    int ends[2] = {-1, -1};
    if (server.empty() || ::pipe(ends) != 0)
        return;
    server_ = ::fork();
    if (server_ == 0)
    {
        const int nowhere = ::open("/dev/null", O_RDWR);
        ::dup2(nowhere, 1);
        ::dup2(nowhere, 2);
        const std::string number = std::to_string(ends[1]);
        ::execl(server.c_str(), "Xvfb", "-displayfd", number.c_str(), "-screen", "0",
                "1600x1200x24", "-nolisten", "tcp", "-noreset", nullptr);
        ::_exit(99);
    }
    ::close(ends[1]);
    // The server writes its number when it listens.
    std::string number;
    for (char c = 0; ::read(ends[0], &c, 1) == 1 && c != '\n';)
        number += c;
    ::close(ends[0]);
    if (!number.empty())
        name_ = ":" + number;
}

Display::~Display()
{
    if (server_ <= 0)
        return;
    ::kill(server_, SIGTERM);
    ::waitpid(server_, nullptr, 0);
}

} // namespace cellwarp::core::support
