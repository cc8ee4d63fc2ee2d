// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/rbf_systems.h"

#include <cstring>

#include "octree/base/hash.h"

namespace cellwarp
{

std::shared_ptr<const RbfSystem>
RbfSystems::find(std::uint64_t hash, std::span<const Eigen::Vector3d> centres) const
{
    const auto [begin, end] = systems_.equal_range(hash);
    for (auto it = begin; it != end; ++it)
    {
        const Kept& kept = it->second;
        // Zeros of different signs are different: they might show in a result.
        if (kept.centres.size() == centres.size() &&
            std::memcmp(kept.centres.data(), centres.data(), centres.size_bytes()) == 0)
            return kept.system;
    }
    return nullptr;
}

RbfSystems::Found RbfSystems::system_of(std::span<const Eigen::Vector3d> centres)
{
    const std::uint64_t hash = hash_of(centres.data(), centres.size_bytes());
    {
        const std::lock_guard lock(mutex_);
        if (std::shared_ptr<const RbfSystem> known = find(hash, centres))
            return {std::move(known), false, true};
    }
    auto made = std::make_shared<const RbfSystem>(centres);
    const std::size_t bytes = made->num_bytes() + centres.size_bytes();
    const std::lock_guard lock(mutex_);
    // Another thread may have been first.
    if (std::shared_ptr<const RbfSystem> known = find(hash, centres))
        return {std::move(known), true, true};
    if (num_bytes_ + bytes > max_bytes_)
        return {std::move(made), true, false};
    num_bytes_ += bytes;
    systems_.emplace(hash, Kept{{centres.begin(), centres.end()}, made});
    return {std::move(made), true, true};
}

void RbfSystems::drop_unused()
{
    const std::lock_guard lock(mutex_);
    std::erase_if(systems_,
                  [&](const auto& entry)
                  {
                      const Kept& kept = entry.second;
                      if (kept.system.use_count() > 1)
                          return false;
                      num_bytes_ -= kept.system->num_bytes() +
                                    kept.centres.size() * sizeof(Eigen::Vector3d);
                      return true;
                  });
}

} // namespace cellwarp
