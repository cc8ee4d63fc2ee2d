// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers as a geometry file stores them: decimal tokens or binary of any type
// and byte order.
#pragma once

#include <cstddef>
#include <string>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Size of a binary number [bytes]; 0 for text.
std::size_t stored_size(Scalar type);

/// The number at \p bytes, which must hold stored_size(type) of them.
double load_stored(const char* bytes, Scalar type, bool big_endian);

/// The same for \p count numbers, each \p stride bytes behind the one before; number i
/// goes to values[i * value_stride].
void load_stored(const char* bytes, std::size_t stride, Scalar type, bool big_endian,
                 std::size_t count, double* values, std::size_t value_stride);

/// Whether an integer type can hold \p value exactly; true for a real type.
bool fits_stored(Scalar type, double value);

/// Puts \p value, rounded to the nearest that the binary \p type has, in the place of the
/// stored_size(type) bytes there. False if it is outside the type's range.
bool overwrite_stored(double value, Scalar type, bool big_endian, char* bytes);

/// \p value as bytes of \p type (text: shortest decimal), rounded to the nearest
/// that the type has. False if it is outside the type's range.
bool store(double value, Scalar type, bool big_endian, std::string& out);

} // namespace cellwarp::core
