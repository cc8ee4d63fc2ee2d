// SPDX-License-Identifier: GPL-3.0-or-later
// Helpers: programs of cellwarp's own that do a piece of work in a fresh process, because
// a library might crash, or depends on what was done before.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cellwarp::core
{

/// The folder of the running program, however it was called; empty where the system does
/// not say it.
std::string program_folder();

/// End of a helper's run, and what it wrote to stdout.
struct HelperEnd
{
    int code = -1;  ///< -1: a signal ended it
    int signal = 0; ///< 0: none
    std::string out;
};

/// Runs a helper to its end, with \p input as its stdin. It has no environment but the
/// search path for libraries, and no signal is blocked or ignored. Its program is looked
/// for in the folder that the environment variable CELLWARP_HELPERS names, there alone;
/// where that is not set, beside the running program, beside the shared library, and
/// where cellwarp was installed.
/// Throws std::system_error, which names the folders where it is in none of them, and
/// std::bad_alloc.
HelperEnd run_helper(const std::string& name, const std::vector<std::string>& arguments,
                     std::string_view input);

} // namespace cellwarp::core
