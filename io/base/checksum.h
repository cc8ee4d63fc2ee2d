// SPDX-License-Identifier: GPL-3.0-or-later
// The checksum of our own binary files.
#pragma once

#include <cstdint>
#include <string_view>

namespace cellwarp::core
{

/// CRC-32 (the polynomial of zlib and PNG) of \p bytes; \p before is the checksum of
/// what stands before them, 0: nothing.
std::uint32_t checksum_of(std::string_view bytes, std::uint32_t before = 0);

} // namespace cellwarp::core
