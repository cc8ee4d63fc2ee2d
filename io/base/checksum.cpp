// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/checksum.h"

#include <zlib.h>

namespace cellwarp::core
{

std::uint32_t checksum_of(std::string_view bytes, std::uint32_t before)
{
    return static_cast<std::uint32_t>(crc32_z(
        before, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

} // namespace cellwarp::core
