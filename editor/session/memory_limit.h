// SPDX-License-Identifier: GPL-3.0-or-later
// How much memory the program may take where nobody says so.
#pragma once

#include <string>

namespace cellwarp
{

/// 70 % of what is there [byte]: what the system says is available or, where that is
/// less, what the process's control group or one above it still leaves to it (versions 1
/// and 2). 0, no limit, where neither is told. \p proc: the folder of the system's own
/// files.
double default_memory_limit(const std::string& proc = "/proc");

} // namespace cellwarp
