// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/packed.h"

#include "io/base/number.h"

namespace cellwarp::core
{

void overwrite_changed(const ByteOffsets& places, std::span<const double> before,
                       std::span<const double> after, const std::string& file,
                       std::string& body)
{
    for_each_change(places, before, after, file,
                    [&](std::uint64_t start, const std::string& stored)
                    { body.replace(start, stored.size(), stored); });
}

Error does_not_fit(const std::string& file, std::uint64_t start, double value)
{
    return malformed({file, 0, "byte " + std::to_string(start)},
                     "the deformed value does not fit the type it is stored in (got " +
                         shortest(value) + ")");
}

} // namespace cellwarp::core
