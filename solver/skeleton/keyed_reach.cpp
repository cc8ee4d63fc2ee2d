// SPDX-License-Identifier: GPL-3.0-or-later
// A solution depends on where its search begins. For the pose to be a function of the
// time alone, and continuous, solutions are sampled once: from the first key to the last
// one, each from the one before, so close that nothing goes farther than a small part of
// the skeleton's size from one to the next. At any time between two samples the search
// begins with the turns between theirs: so near to a solution that it ends in that one,
// and at a sample exactly in the sample.
//
// Joints with keys of turns do as these say and are left out of the chains. A hold turns
// them nevertheless: between two poses both of which have the joint at its place,
// interpolated turns leave it a little beside.
#include "solver/skeleton/keyed_reach.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Way from sample to sample, at the most [size of the skeleton].
constexpr double kWayOfSample = 1.0 / 32.0;
constexpr double kMostSamples = 1024.0; ///< between two keys
/// Times between two keys at which a way is measured.
constexpr int kProbesOfKeys = 8;

} // namespace

KeyedReach::KeyedReach(Skeleton skeleton, std::vector<KeyedPlace> places,
                       std::span<const std::size_t> keyed_joints,
                       std::span<const double> times, const Keyed& keyed)
    : skeleton_(std::move(skeleton)), places_(std::move(places)), misses_(places_.size())
{
    for (std::size_t j = 0; j < skeleton_.size(); ++j)
        size_ = std::max(size_, (skeleton_[j].at - skeleton_[0].at).norm());
    const auto has_keys = [&](int joint)
    {
        return std::find(keyed_joints.begin(), keyed_joints.end(), idx(joint)) !=
               keyed_joints.end();
    };
    std::set<std::size_t> turned;
    for (KeyedPlace& place : places_)
    {
        if (!place.is_hold)
            std::erase_if(place.chain, has_keys);
        for (const int joint : place.chain)
            turned.insert(idx(joint));
    }
    joints_.assign(turned.begin(), turned.end());
    for (const std::size_t joint : joints_)
        if (!has_keys(static_cast<int>(joint)))
            free_.emplace_back(joint, TurnKeys());
    if (std::any_of(places_.begin(), places_.end(),
                    [](const KeyedPlace& place) { return !place.is_hold; }))
        sample(times, keyed);
}

/// Searches from \p pose. Returns the distance of each joint from its place.
std::vector<double> KeyedReach::reach_from(double time, SkeletonPose& pose) const
{
    skeleton_.limit(pose);
    std::vector<ReachTarget> targets;
    std::vector<std::size_t> numbers;
    for (std::size_t k = 0; k < places_.size(); ++k)
        if (places_[k].acts_at(time))
        {
            numbers.push_back(k);
            targets.push_back(
                {places_[k].joint, places_[k].places.at(time), places_[k].chain});
        }
    std::vector<double> misses(places_.size(), 0.0);
    if (targets.empty())
        return misses;
    const ReachReport report = reach(skeleton_, targets, pose);
    for (std::size_t k = 0; k < numbers.size(); ++k)
        misses[numbers[k]] = report.misses[k];
    return misses;
}

void KeyedReach::copy_free_turns(const SkeletonPose& from, SkeletonPose& to) const
{
    for (const auto& [joint, keys] : free_)
        to.turns[joint] = from.turns[joint];
}

/// The number of samples in which joints and places go no farther than kWayOfSample each.
int KeyedReach::parts_of(double from, double to, const SkeletonPose& last,
                         const Keyed& keyed) const
{
    const auto places_at = [&](double time)
    {
        SkeletonPose pose = keyed(time);
        copy_free_turns(last, pose);
        const std::vector<Motion> motions = skeleton_.motions(pose);
        std::vector<Vector3d> places;
        for (std::size_t j = 0; j < skeleton_.size(); ++j)
            places.push_back(motions[j](skeleton_[j].at));
        for (const KeyedPlace& place : places_)
            places.push_back(place.places.at(time));
        return places;
    };
    std::vector<Vector3d> before = places_at(from);
    std::vector<double> ways(before.size(), 0.0);
    for (int probe = 1; probe <= kProbesOfKeys; ++probe)
    {
        std::vector<Vector3d> now = places_at(from + (to - from) * probe / kProbesOfKeys);
        for (std::size_t k = 0; k < now.size(); ++k)
            ways[k] += (now[k] - before[k]).stableNorm();
        before = std::move(now);
    }
    const double way = *std::max_element(ways.begin(), ways.end());
    return static_cast<int>(
        std::clamp(std::ceil(way / (kWayOfSample * size_)), 1.0, kMostSamples));
}

void KeyedReach::sample(std::span<const double> times, const Keyed& keyed)
{
    SkeletonPose last = skeleton_.rest();
    const auto add = [&](double time)
    {
        SkeletonPose pose = keyed(time);
        copy_free_turns(last, pose);
        const std::vector<double> misses = reach_from(time, pose);
        for (std::size_t k = 0; k < places_.size(); ++k)
            if (misses[k] > size_ * misses_[k].distance)
                misses_[k] = {misses[k] / size_, time};
        for (auto& [joint, keys] : free_)
        {
            keys.turns.push_back(nearer_sign(last.turns[joint], pose.turns[joint]));
            keys.times.push_back(time);
        }
        last = std::move(pose);
    };
    add(times.front());
    for (std::size_t k = 1; k < times.size(); ++k)
    {
        const double from = times[k - 1], to = times[k];
        const int parts = parts_of(from, to, last, keyed);
        double time = from;
        for (int part = 1; part <= parts; ++part)
        {
            const double next = part == parts ? to : from + (to - from) * part / parts;
            if (next > time) // keys may be too close for parts
                add(time = next);
        }
    }
}

void KeyedReach::solve(double time, SkeletonPose& pose) const
{
    for (const auto& [joint, keys] : free_)
        pose.turns[joint] = keys.at(time);
    reach_from(time, pose);
}

} // namespace cellwarp::core
