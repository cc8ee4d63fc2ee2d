// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/hash.h"

#include <xxhash.h>

namespace cellwarp::core
{

std::uint64_t hash_of(const void* bytes, std::size_t count, std::uint64_t seed)
{
    return XXH3_64bits_withSeed(bytes, count, seed);
}

std::uint64_t hash_of(const Eigen::Vector3d& x)
{
    // Adding 0 makes a zero of either sign one.
    const Eigen::Vector3d signless = x.array() + 0.0;
    return hash_of(signless.data(), sizeof signless);
}

} // namespace cellwarp::core
