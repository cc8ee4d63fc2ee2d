// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/rbf_systems.h"

#include <cstring>
#include <utility>

#include "octree/base/hash.h"

namespace cellwarp::core
{

bool RbfSystems::are_same(std::span<const Eigen::Vector3d> a,
                          std::span<const Eigen::Vector3d> b)
{
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

std::shared_ptr<const RbfSystem>
RbfSystems::find(std::uint64_t hash, std::span<const Eigen::Vector3d> centres) const
{
    const auto [begin, end] = systems_.equal_range(hash);
    for (auto it = begin; it != end; ++it)
        if (are_same(it->second.centres, centres))
            return it->second.system;
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
    Kept made{{centres.begin(), centres.end()},
              std::make_shared<const RbfSystem>(centres)};
    const std::size_t bytes = made.num_bytes();
    const std::lock_guard lock(mutex_);
    // Another thread may have been first.
    if (std::shared_ptr<const RbfSystem> known = find(hash, centres))
        return {std::move(known), true, true};
    if (num_bytes_ + bytes > max_bytes_)
        drop_those_not_held();
    if (num_bytes_ + bytes > max_bytes_)
        return {std::move(made.system), true, false};
    num_bytes_ += bytes;
    const auto added = systems_.emplace(hash, std::move(made));
    return {added->second.system, true, true};
}

void RbfSystems::drop_those_not_held()
{
    std::erase_if(systems_,
                  [&](const auto& entry)
                  {
                      const Kept& kept = entry.second;
                      if (kept.system.use_count() > 1)
                          return false;
                      num_bytes_ -= kept.num_bytes();
                      return true;
                  });
}

void RbfSystems::drop_unused()
{
    const std::lock_guard lock(mutex_);
    drop_those_not_held();
}

void RbfSystems::clear()
{
    const std::lock_guard lock(mutex_);
    systems_.clear();
    num_bytes_ = 0;
}

std::size_t RbfSystems::num_bytes() const
{
    const std::lock_guard lock(mutex_);
    return num_bytes_;
}

} // namespace cellwarp::core
