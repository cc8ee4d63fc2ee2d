// SPDX-License-Identifier: GPL-3.0-or-later
// Regions and moves from the command line, where no handle file is worth its while.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "io/scene/handle_file.h"

namespace cellwarp::core
{

/// --fix, --handle, --move and --relative.
class FlagScript
{
public:
    void add_to(CLI::App& app);
    /// Whether there is any region or move.
    bool is_given() const
    {
        return !fixes_.empty() || !handles_.empty() || !moves_.empty();
    }
    /// Whether --relative stands alone, for nothing.
    bool is_lost() const { return is_relative_ && !is_given(); }
    /// One frame with all moves. Throws Fault::Usage, naming the flag.
    HandleFile handles() const;

private:
    /// Throws Fault::Usage where a name is missing, or stands where there is none.
    void check_names() const;

    std::vector<std::string> fixes_, handles_, moves_;
    bool is_relative_ = false;
};

} // namespace cellwarp::core
