// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/machine.h"

#include <fstream>
#include <thread>

namespace cellwarp::core
{

namespace
{

std::string processor_name()
{
    std::ifstream info("/proc/cpuinfo");
    for (std::string line; std::getline(info, line);)
    {
        const std::size_t colon = line.find(": ");
        if (line.starts_with("model name") && colon != std::string::npos)
            return line.substr(colon + 2);
    }
    return "unknown";
}

std::string compiler_name()
{
#if defined(__clang__)
    return "clang " __clang_version__;
#elif defined(__GNUC__)
    return "gcc " __VERSION__;
#else
    return "unknown";
#endif
}

} // namespace

Machine this_machine()
{
    return {processor_name(), static_cast<int>(std::thread::hardware_concurrency()),
            compiler_name(), CELLWARP_BUILD_TYPE, CELLWARP_VERSION};
}

} // namespace cellwarp::core
