// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers as text, the same in every locale: strict reading, shortest writing.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cellwarp::core
{

/// The whole token as a double; a leading plus sign is allowed. "nan" and "inf"
/// parse to what they say, an overflow to infinity, an underflow to zero:
/// whoever reads a coordinate checks that it is finite. Nothing if the token is
/// no number.
std::optional<double> parse_double(std::string_view token);

/// The whole token as a decimal integer; nothing if it is none or does not fit.
std::optional<std::int64_t> parse_integer(std::string_view token);

/// The shortest decimal text that reads back as the same double.
std::string shortest(double value);

/// The same at the end of \p out.
void append_shortest(double value, std::string& out);

/// A token as it may stand in a message: cut to 40 characters, without control
/// characters, in quotes.
std::string in_quotes(std::string_view token);

/// "340 MB" or "1.4 GB", for messages.
std::string in_bytes(double bytes);

} // namespace cellwarp::core
