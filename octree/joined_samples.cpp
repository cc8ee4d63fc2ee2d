// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/joined_samples.h"

#include <algorithm>
#include <array>
#include <bit>

#include "octree/base/hash.h"

namespace cellwarp
{

std::vector<std::uint32_t> joined_samples(const std::vector<Eigen::Vector3d>& samples)
{
    constexpr std::uint32_t none = ~std::uint32_t{0};
    std::vector<std::uint32_t> joined(samples.size());
    // Open addressing, at most half full: a place goes behind those that have its slot.
    std::vector<std::uint32_t> first_at(std::bit_ceil(2 * samples.size() + 1), none);
    // Slots lie anywhere: those of the next samples are fetched meanwhile.
    constexpr std::size_t kAhead = 16;
    const std::size_t last_slot = first_at.size() - 1;
    std::array<std::size_t, kAhead> slots;
    const auto fetch = [&](std::size_t i)
    {
        slots[i % kAhead] = hash_of(samples[i]) & last_slot;
        __builtin_prefetch(&first_at[slots[i % kAhead]], 1);
    };
    for (std::size_t i = 0; i < std::min(kAhead, samples.size()); ++i)
        fetch(i);
    for (std::uint32_t i = 0; i < samples.size(); ++i)
    {
        for (std::size_t slot = slots[i % kAhead];; ++slot)
        {
            std::uint32_t& first = first_at[slot & last_slot];
            if (first == none)
                first = i;
            if (first == i || samples[first] == samples[i])
            {
                joined[i] = first;
                break;
            }
        }
        if (i + kAhead < samples.size())
            fetch(i + kAhead);
    }
    return joined;
}

} // namespace cellwarp
