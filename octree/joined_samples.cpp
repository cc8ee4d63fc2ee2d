// SPDX-License-Identifier: GPL-3.0-or-later
// Places are told apart by a table of slots, open addressing, at most half full. Many
// samples are dealt to parts by their hashes: each part has a table of its own, which one
// thread fills, small enough to stay near the processor. A part goes through its samples
// in their order, so the first at a place is the same for every number of parts.
#include "octree/joined_samples.h"

#include <array>
#include <bit>

#include "octree/base/hash.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

constexpr std::uint32_t kNone = ~std::uint32_t{0};
constexpr std::size_t kSamplesAtOnce = 4096; // of one thread

/// So many samples are worth several parts; how many they are is a power of two.
constexpr std::size_t kManySamples = std::size_t{1} << 16;
constexpr unsigned kBitsOfPart = 4;
constexpr std::size_t kParts = std::size_t{1} << kBitsOfPart;

/// Joins the samples of a part. \p count: how many they are.
void join_part(const std::vector<Eigen::Vector3d>& samples,
               const std::vector<std::uint32_t>& hashes, std::size_t part,
               unsigned bits_of_part, std::size_t count,
               std::vector<std::uint32_t>& joined)
{
    std::vector<std::uint32_t> first_at(std::bit_ceil(2 * count + 1), kNone);
    const std::size_t last_slot = first_at.size() - 1;
    for (std::uint32_t i = 0; i < samples.size(); ++i)
    {
        // A shift by all bits would be none.
        if (bits_of_part > 0 && hashes[i] >> (32 - bits_of_part) != part)
            continue;
        for (std::size_t slot = hashes[i];; ++slot)
        {
            std::uint32_t& first = first_at[slot & last_slot];
            if (first == kNone)
                first = i;
            if (first == i || samples[first] == samples[i])
            {
                joined[i] = first;
                break;
            }
        }
    }
}

} // namespace

std::vector<std::uint32_t> joined_samples(const std::vector<Eigen::Vector3d>& samples)
{
    std::vector<std::uint32_t> joined(samples.size()), hashes(samples.size());
    parallel_for(samples.size(), kSamplesAtOnce,
                 [&](std::size_t i)
                 { hashes[i] = static_cast<std::uint32_t>(hash_of(samples[i])); });
    if (samples.size() < kManySamples)
    {
        join_part(samples, hashes, 0, 0, samples.size(), joined);
        return joined;
    }
    std::array<std::size_t, kParts> counts{};
    for (const std::uint32_t hash : hashes)
        ++counts[hash >> (32 - kBitsOfPart)];
    parallel_for(kParts, 1,
                 [&](std::size_t part) {
                     join_part(samples, hashes, part, kBitsOfPart, counts[part], joined);
                 });
    return joined;
}

} // namespace cellwarp::core
