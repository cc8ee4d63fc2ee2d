// SPDX-License-Identifier: GPL-3.0-or-later
// Cells, faces and voxels are counted in int; the standard library's containers want
// something else. Where numbers of two kinds meet, one of them has a type of its own
// (an enum class over int), so that they are not taken for each other.
#pragma once

#include <concepts>
#include <cstddef>
#include <type_traits>

namespace cellwarp::core
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

/// The numbers from 0 to before a count, for loops over them. (The standard's views are
/// beyond clang 14.)
template <class Number>
requires std::is_enum_v<Number>
class NumbersBelow
{
public:
    class Iterator
    {
    public:
        constexpr explicit Iterator(std::size_t at) : at_(at) {}
        constexpr Number operator*() const { return static_cast<Number>(at_); }
        constexpr Iterator& operator++()
        {
            ++at_;
            return *this;
        }
        constexpr bool operator==(const Iterator&) const = default;

    private:
        std::size_t at_;
    };

    constexpr explicit NumbersBelow(std::size_t count) : count_(count) {}
    constexpr Iterator begin() const { return Iterator(0); }
    constexpr Iterator end() const { return Iterator(count_); }

private:
    std::size_t count_;
};

/// The numbers from 0 to before \p count.
template <class Number>
constexpr NumbersBelow<Number> numbers_below(std::size_t count)
{
    return NumbersBelow<Number>(count);
}

} // namespace cellwarp::core
