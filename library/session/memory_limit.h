// SPDX-License-Identifier: GPL-3.0-or-later
// How much memory the program may take, and what stands against it before work begins.
#pragma once

#include <string>

namespace cellwarp::core
{

/// What the process has, and 70 % of what is there [byte]: what the system says is
/// available or, where that is less, what the process's control group or one above it
/// still leaves to it (versions 1 and 2). 0, no limit, where neither is told. \p proc:
/// the folder of the system's own files.
double default_memory_limit(const std::string& proc = "/proc");

/// Resident memory of the process now [byte]; 0 where the system does not tell.
double resident_memory(const std::string& proc = "/proc");

/// What the process has with \p more [byte]. Where that is over \p max_memory (0: no
/// limit), what it no longer needs is given back to the system first.
double memory_with(double more, double max_memory);

/// Throws Fault::Budget where reading a geometry file of such a size takes more than
/// \p max_memory [byte] (0: no limit). A file that is not there is no concern of it.
void check_memory_of_file(const std::string& path, double max_memory);

} // namespace cellwarp::core
