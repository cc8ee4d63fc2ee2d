// SPDX-License-Identifier: GPL-3.0-or-later
// Cells, faces and voxels are counted in int; the standard library's containers want
// something else. Where numbers of two kinds meet, one of them has a type of its own
// (an enum class over int), so that they are not taken for each other.
#pragma once

#include <concepts>
#include <cstddef>
#include <ranges>
#include <type_traits>

namespace cellwarp
{

/// An index for a container. \pre not negative
template <std::integral Number>
constexpr std::size_t idx(Number number)
{
    return static_cast<std::size_t>(number);
}

/// The same of a number with a type of its own.
template <class Number>
requires std::is_enum_v<Number>
constexpr std::size_t idx(Number number)
{
    return static_cast<std::size_t>(number);
}

/// The numbers from 0 to before \p count.
template <class Number>
requires std::is_enum_v<Number>
constexpr auto numbers_below(std::size_t count)
{
    return std::views::iota(std::size_t{0}, count) |
           std::views::transform([](std::size_t number)
                                 { return static_cast<Number>(number); });
}

} // namespace cellwarp
