// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/packed.h"

#include "io/number.h"
#include "io/stored_number.h"

namespace cellwarp
{

void overwrite_changed(const Places& places, std::span<const double> before,
                       std::span<const double> after, const std::string& file,
                       std::string& body)
{
    std::string stored;
    for (std::size_t i = 0; i < after.size(); ++i)
    {
        if (before[i] == after[i])
            continue;
        stored.clear();
        if (!store(after[i], places.scalars[i % places.length], places.big_endian,
                   stored))
            throw does_not_fit(file, places.starts[i], after[i]);
        body.replace(places.starts[i], stored.size(), stored);
    }
}

Error does_not_fit(const std::string& file, std::uint64_t start, double value)
{
    return malformed({file, 0, "byte " + std::to_string(start)},
                     "the deformed value does not fit the type it is stored in (got " +
                         shortest(value) + ")");
}

} // namespace cellwarp
