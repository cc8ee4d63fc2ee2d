// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/relative_name.h"

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "io/base/error.h"

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

/// The folder of a file, absolute and without links.
fs::path real_folder(const std::string& file)
{
    std::error_code error;
    fs::path folder = fs::absolute(file, error).parent_path();
    if (!error)
        folder = fs::weakly_canonical(folder, error);
    if (error)
        throw Error(Fault::File,
                    at({file, 0, ""}, "cannot find its folder: " + error.message()));
    return folder;
}

} // namespace

std::string resolved_name(const std::string& file, const std::string& name)
{
    const fs::path path(name);
    return path.is_absolute() ? name : (fs::path(file).parent_path() / path).string();
}

std::string relative_name(const std::string& file, const std::string& target)
{
    // In the same folder, by the same spelling: whatever the links, it is this.
    const std::string folder = fs::path(file).parent_path().string();
    if (target.starts_with(folder))
    {
        std::string rest = target.substr(folder.size());
        if (!folder.empty() && rest.starts_with('/'))
            rest.erase(0, 1);
        if (!fs::path(rest).is_absolute() && resolved_name(file, rest) == target)
            return rest;
    }
    const fs::path from = real_folder(file), to = real_folder(target);
    const fs::path name = fs::path(target).filename();
    const auto common = std::mismatch(from.begin(), from.end(), to.begin(), to.end());
    const bool shares_a_folder = std::distance(from.begin(), common.first) > 1;
    return ((shares_a_folder ? to.lexically_relative(from) : to) / name)
        .lexically_normal()
        .string();
}

} // namespace cellwarp::core
