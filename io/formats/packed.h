// SPDX-License-Identifier: GPL-3.0-or-later
// Patching of numbers that do not stand in the file's bytes as they are, but in a body
// that these are unpacked to: all of them binary, in any order.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/base/error.h"
#include "io/formats/geometry.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

/// A list of vectors as its numbers.
template <class Vectors>
std::span<const double> numbers_of(const Vectors& vectors)
{
    return {reinterpret_cast<const double*>(vectors.data()),
            vectors.size() * sizeof(*vectors.data()) / sizeof(double)};
}

/// Whether a number changes; what is no number (NaN) does not if it stays none.
inline bool differs(double before, double after)
{
    return before != after && !(std::isnan(before) && std::isnan(after));
}

/// The error for a number that its type cannot hold.
Error does_not_fit(const std::string& file, std::uint64_t start, double value);

/// Calls put(start, bytes) for every number that changes, with its place and how it is
/// stored. Throws Fault::Malformed, naming \p file, if one does not fit its stored type.
template <class Put>
void for_each_change(const ByteOffsets& places, std::span<const double> before,
                     std::span<const double> after, const std::string& file, Put&& put)
{
    std::string stored;
    for (std::size_t i = 0; i < after.size(); ++i)
    {
        if (!differs(before[i], after[i]))
            continue;
        stored.clear();
        if (!store(after[i], places.scalars[i % places.length], places.big_endian,
                   stored))
            throw does_not_fit(file, places.start(i), after[i]);
        put(places.start(i), stored);
    }
}

/// Overwrites the numbers that change, at their places in \p body.
/// Throws Fault::Malformed, naming \p file, if one does not fit its stored type.
void overwrite_changed(const ByteOffsets& places, std::span<const double> before,
                       std::span<const double> after, const std::string& file,
                       std::string& body);

} // namespace cellwarp::core
