// SPDX-License-Identifier: GPL-3.0-or-later
// Inverse kinematics in time: joints that reach places which move. keyed_reach.cpp
// explains how a pose becomes a function of the time alone.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "solver/skeleton/joint_keys.h"
#include "solver/skeleton/reach.h"
#include "solver/skeleton/skeleton.h"

namespace cellwarp::core
{

/// A joint that reaches the places of its keys.
struct KeyedPlace
{
    int joint = 0;
    std::vector<int> chain; ///< joints above it that turn for it, in any order
    ShiftKeys places;       ///< with a key at least
    /// false: it acts at all times, and joints of its chain that have keys of their own
    /// are left out. true: it acts from its first to its last key alone, and turns these,
    /// too, from where their keys have them.
    bool is_hold = false;

    bool acts_at(double time) const
    {
        return !is_hold || (places.times.front() <= time && time <= places.times.back());
    }
};

/// Immutable.
class KeyedReach
{
public:
    /// Pose of the joints at a time by their own keys; a joint without keys is at rest.
    using Keyed = std::function<SkeletonPose(double)>;

    /// \p keyed_joints: those that have keys of turns. \p times: of all keys, ascending.
    KeyedReach(Skeleton skeleton, std::vector<KeyedPlace> places,
               std::span<const std::size_t> keyed_joints, std::span<const double> times,
               const Keyed& keyed);

    /// Turns the joints of the chains in \p pose, which is what Keyed has at \p time.
    void solve(double time, SkeletonPose& pose) const;
    /// Joints that it turns, ascending.
    const std::vector<std::size_t>& joints() const { return joints_; }
    const Skeleton& skeleton() const { return skeleton_; }

    /// The largest distance of a joint from its place in the whole motion.
    struct Miss
    {
        double distance = 0.0; ///< [size of the skeleton]
        double time = 0.0;
    };
    /// One for each place, 0 for a hold. Less than kReached is rounding.
    const std::vector<Miss>& misses() const { return misses_; }
    static constexpr double kReached = 1e-6;

private:
    std::vector<double> reach_from(double time, SkeletonPose& pose) const;
    void sample(std::span<const double> times, const Keyed& keyed);
    int parts_of(double from, double to, const SkeletonPose& last,
                 const Keyed& keyed) const;
    void copy_free_turns(const SkeletonPose& from, SkeletonPose& to) const;

    Skeleton skeleton_;
    double size_ = 0.0; ///< of the skeleton
    std::vector<KeyedPlace> places_;
    std::vector<std::size_t> joints_;
    /// Joints of the chains without keys of turns, and their solutions at samples.
    std::vector<std::pair<std::size_t, TurnKeys>> free_;
    std::vector<Miss> misses_;
};

} // namespace cellwarp::core
