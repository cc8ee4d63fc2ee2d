// SPDX-License-Identifier: GPL-3.0-or-later
// Parts of a shape by what becomes of them when regions hold it, and warnings.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "library/session/cell_system.h"

namespace cellwarp::core
{

/// Components that have samples, by what becomes of them.
struct PartsByHold
{
    std::size_t held = 0;   ///< by regions
    std::size_t follow = 0; ///< others
    std::size_t stay = 0;   ///< at rest
};

PartsByHold parts_by_hold(const CellSystem& system);

/// Warnings where stiffness differs extremely, where parts have no region or may still
/// turn, where nothing but one handle is held, where all is held, where a handle holds
/// a small piece apart from the rest of it, and where a rod has fewer spans than stated.
/// \p file: of the regions.
std::vector<std::string> holding_warnings(const CellSystem& system,
                                          const std::string& file);

} // namespace cellwarp::core
