// SPDX-License-Identifier: GPL-3.0-or-later
// Warnings of odd parts of a shape that its regions hold.
#pragma once

#include <string>
#include <vector>

#include "library/session/cell_system.h"

namespace cellwarp::core
{

/// Warnings where nothing but one handle is held, where all is held, where a handle holds
/// a small piece apart from the rest of it, and where a rod has fewer spans than stated.
/// \p file: of the regions.
std::vector<std::string> holding_warnings(const CellSystem& system,
                                          const std::string& file);

} // namespace cellwarp::core
