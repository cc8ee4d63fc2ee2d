// SPDX-License-Identifier: GPL-3.0-or-later
// Factored RBF systems that later fits may use again. Where cells change in one place the
// groups of cells elsewhere keep their centres, and with them their equations.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "solver/field/rbf.h"

namespace cellwarp::core
{

/// Systems by their centres. Changes no bit of a fit: a system that is kept is the one
/// that would be made. Safe for many threads.
class RbfSystems
{
public:
    /// Those of some 100,000 cells; of more, fits go on to make some anew.
    static constexpr std::size_t kMostBytes = std::size_t(1) << 30;

    /// No more of them are kept when all take \p max_bytes.
    explicit RbfSystems(std::size_t max_bytes = kMostBytes) : max_bytes_(max_bytes) {}

    struct Found
    {
        std::shared_ptr<const RbfSystem> system;
        bool is_new = false;
        bool is_kept = false; ///< else there was no room
    };
    /// The one of these centres, made if it is not kept. Where the room is short, those
    /// that nobody holds give way. \pre not empty
    Found system_of(std::span<const Eigen::Vector3d> centres);

    /// Whether centres are the same to the bit: zeros of different signs might show in a
    /// result.
    static bool are_same(std::span<const Eigen::Vector3d> a,
                         std::span<const Eigen::Vector3d> b);

    /// Forgets those that nobody holds at that moment.
    void drop_unused();
    /// Forgets all; who holds one keeps it.
    void clear();

    std::size_t num_bytes() const;

private:
    struct Kept
    {
        std::vector<Eigen::Vector3d> centres;
        std::shared_ptr<const RbfSystem> system;
        std::size_t num_bytes() const
        {
            return system->num_bytes() + centres.size() * sizeof(Eigen::Vector3d);
        }
    };
    // \pre the mutex is held
    std::shared_ptr<const RbfSystem> find(std::uint64_t hash,
                                          std::span<const Eigen::Vector3d> centres) const;
    void drop_those_not_held();

    std::size_t max_bytes_, num_bytes_ = 0;
    mutable std::mutex mutex_;
    std::unordered_multimap<std::uint64_t, Kept> systems_; ///< by their centres' hash
};

} // namespace cellwarp::core
