// SPDX-License-Identifier: GPL-3.0-or-later
// What measurements depend on beside the input.
#pragma once

#include <string>

namespace cellwarp::core
{

struct Machine
{
    std::string processor; ///< "unknown" where the system does not tell
    int cores = 0;
    std::string compiler, build, version; ///< of this program
};

Machine this_machine();

} // namespace cellwarp::core
