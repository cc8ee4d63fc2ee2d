// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/places.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "octree/base/helper.h"

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

constexpr std::size_t kMostRecent = 12;

fs::path resolved(const std::string& path)
{
    std::error_code failure;
    const fs::path whole = fs::absolute(path, failure);
    const fs::path real = fs::weakly_canonical(whole, failure);
    return failure ? whole.lexically_normal() : real;
}

} // namespace

bool is_same_path(const std::string& a, const std::string& b)
{
    return a == b || resolved(a) == resolved(b);
}

std::string state_folder()
{
    const char* state = std::getenv("XDG_STATE_HOME");
    const char* home = std::getenv("HOME");
    fs::path folder;
    if (state != nullptr && fs::path(state).is_absolute())
        folder = fs::path(state) / "cellwarp";
    else if (home != nullptr && *home != 0)
        folder = fs::path(home) / ".local" / "state" / "cellwarp";
    else
        return "";
    std::error_code failure;
    fs::create_directories(folder, failure);
    return failure ? "" : folder.string();
}

RecentFiles::RecentFiles(std::string folder)
    : file_(folder.empty() ? "" : std::move(folder) + "/recent")
{
    std::ifstream file(file_);
    for (std::string line; std::getline(file, line) && paths_.size() < kMostRecent;)
        if (!line.empty())
            paths_.push_back(line);
}

void RecentFiles::add(const std::string& path)
{
    std::error_code failure;
    const std::string whole = fs::absolute(path, failure).lexically_normal().string();
    if (failure || whole.find('\n') != std::string::npos)
        return;
    std::erase_if(paths_,
                  [&](const std::string& old) { return is_same_path(old, whole); });
    paths_.insert(paths_.begin(), whole);
    if (paths_.size() > kMostRecent)
        paths_.resize(kMostRecent);
    write();
}

void RecentFiles::forget(const std::string& path)
{
    if (std::erase_if(paths_, [&](const std::string& old)
                      { return is_same_path(old, path); }) > 0)
        write();
}

void RecentFiles::write() const
{
    if (file_.empty())
        return;
    std::string text;
    for (const std::string& path : paths_)
        text += path + '\n';
    try
    {
        write_file(file_, text, Overwrite::Yes);
    }
    catch (const Error&)
    {
        // The list is a convenience: the editor works without it.
    }
}

std::vector<std::string> sample_scenes()
{
    std::error_code failure;
    std::vector<fs::path> folders = {fs::current_path(failure) / "samples"};
    if (const fs::path program = program_folder(); !program.empty())
        folders.push_back(program.parent_path() / "samples");
    for (const fs::path& folder : folders)
    {
        std::vector<std::string> scenes;
        for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
             entry.increment(failure))
            if (entry->path().extension() == ".json")
                scenes.push_back(entry->path().string());
        std::sort(scenes.begin(), scenes.end());
        if (!scenes.empty())
            return scenes;
    }
    return {};
}

} // namespace cellwarp::core
