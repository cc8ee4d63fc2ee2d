// SPDX-License-Identifier: GPL-3.0-or-later
// A scanner fed with a file in parts.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "io/formats/geometry.h"

namespace cellwarp::core::support
{

/// What \p scanner makes of \p bytes when they come in parts: the first \p head of
/// them at once, then \p size at a time, what it leaves handed to it again.
template <class Scanner>
Geometry scanned_in_parts(Scanner scanner, const std::string& bytes, std::size_t size,
                          std::size_t head = 0)
{
    Geometry out;
    std::uint64_t start = 0;
    std::size_t end = std::max(head, size);
    std::string rest = bytes.substr(0, end);
    for (;;)
    {
        const std::size_t used = scanner.scan(rest, start, end >= bytes.size(), out);
        start += used;
        rest.erase(0, used);
        if (end >= bytes.size())
            break;
        rest += bytes.substr(end, size);
        end += size;
    }
    scanner.finish(out);
    return out;
}

} // namespace cellwarp::core::support
