// SPDX-License-Identifier: GPL-3.0-or-later
// Programs that stand together.
#pragma once

#include <string>

namespace cellwarp::core
{

/// Where a program of that name stands: in the folder of this one, however it was called.
/// Throws Fault::File where that cannot be found.
std::string program_beside(const std::string& name);

} // namespace cellwarp::core
