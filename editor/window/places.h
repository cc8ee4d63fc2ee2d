// SPDX-License-Identifier: GPL-3.0-or-later
// Where the editor keeps what lasts from one run to the next, and finds its samples.
#pragma once

#include <string>
#include <vector>

namespace cellwarp::core
{

/// $XDG_STATE_HOME/cellwarp or ~/.local/state/cellwarp; made if it is not there. Empty
/// where that cannot be: then nothing is kept.
std::string state_folder();

/// Whether two spellings mean one file, by links and dots.
bool is_same_path(const std::string& a, const std::string& b);

/// The files that were opened last, the newest first.
class RecentFiles
{
public:
    /// \p folder: from state_folder()
    explicit RecentFiles(std::string folder);
    const std::vector<std::string>& paths() const { return paths_; }
    /// Remembers one that was opened. That it cannot be written is no failure.
    void add(const std::string& path);
    void forget(const std::string& path);

private:
    void write() const;
    std::string file_;
    std::vector<std::string> paths_;
};

/// Scenes that ship with the project, where they are found; sorted by name.
std::vector<std::string> sample_scenes();

} // namespace cellwarp::core
