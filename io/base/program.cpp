// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/program.h"

#include <filesystem>

#include "io/base/error.h"

namespace cellwarp::core
{

std::string program_beside(const std::string& name)
{
    std::error_code error;
    const std::filesystem::path self =
        std::filesystem::read_symlink("/proc/self/exe", error);
    if (error)
        throw Error(Fault::File,
                    "cannot find the folder of this program: " + error.message());
    return (self.parent_path() / name).string();
}

} // namespace cellwarp::core
