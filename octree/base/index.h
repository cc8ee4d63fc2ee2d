// SPDX-License-Identifier: GPL-3.0-or-later
// Cells, faces and unknowns are counted in int; the standard library's containers want
// something else.
#pragma once

#include <concepts>
#include <cstddef>

namespace cellwarp
{

/// An index for a container. \pre not negative
template <std::integral Number>
constexpr std::size_t idx(Number number)
{
    return static_cast<std::size_t>(number);
}

} // namespace cellwarp
