// SPDX-License-Identifier: GPL-3.0-or-later
// Folders and files of a test; no room is behind them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace cellwarp::core::support
{

/// A folder of this test's own, empty; removed at the end.
class Folder
{
public:
    Folder();
    ~Folder();
    std::string operator/(const std::string& name) const
    {
        return (path_ / name).string();
    }
    const std::filesystem::path& path() const { return path_; }
    /// Writes a file and gives its path.
    std::string write(const std::string& name, const std::string& bytes) const;

private:
    std::filesystem::path path_;
};

/// Number of entries in a folder, hidden ones too.
std::size_t num_files(const Folder& folder);

std::string bytes_of(const std::string& path);

/// The folder of real models (CELLWARP_TEST_DATA); empty without it.
std::string data_folder();
/// The folder of the samples that ship with the project.
std::string samples_folder();

} // namespace cellwarp::core::support
