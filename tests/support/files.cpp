// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/files.h"

#include <cstdlib>
#include <fstream>
#include <iterator>

#include <unistd.h>

namespace cellwarp::core::support
{

Folder::Folder()
{
    std::string name =
        (std::filesystem::temp_directory_path() / "cellwarp-test-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
}

Folder::~Folder()
{
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

std::string Folder::write(const std::string& name, const std::string& bytes) const
{
    std::ofstream(path_ / name, std::ios::binary) << bytes;
    return (path_ / name).string();
}

std::size_t num_files(const Folder& folder)
{
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder.path()), {}));
}

std::string bytes_of(const std::string& path)
{
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::string data_folder()
{
    const char* folder = std::getenv("CELLWARP_TEST_DATA");
    return folder ? folder : "";
}

std::string samples_folder()
{
    return CELLWARP_SAMPLES;
}

} // namespace cellwarp::core::support
