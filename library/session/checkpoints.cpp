// SPDX-License-Identifier: GPL-3.0-or-later
// Going back by one edit is what users do most, by many what they do rarely: the distance
// between checkpoints grows with their age, so that a few of them serve any length, and
// what has to be done again is at most about as long as the way back.
#include "library/session/checkpoints.h"

#include <algorithm>

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kMostCheckpoints = 16;
/// The newest ones, which are never thinned out.
constexpr std::size_t kNewest = 6;

template <class Items>
std::size_t bytes_of(const Items& items)
{
    return items.size() * sizeof(typename Items::value_type);
}

std::size_t bytes_of(const Octree& octree)
{
    return octree.leaves().size() * (sizeof(Leaf) + sizeof(std::uint64_t)); // and its key
}

std::size_t bytes_of(const StageRest& rest)
{
    std::size_t bytes =
        sizeof rest + bytes_of(rest.samples.samples) + bytes_of(rest.samples.directions) +
        bytes_of(rest.samples.tangents) + bytes_of(rest.samples.rotations);
    if (!rest.shape)
        return bytes;
    const RestShape& shape = *rest.shape;
    return bytes + sizeof shape + bytes_of(shape.samples) +
           bytes_of(shape.material.grid.material()) + bytes_of(shape.material.is_sheet) +
           bytes_of(shape.material.notches.open_sides()) +
           bytes_of(shape.parts.voxel_of_sample) + bytes_of(shape.sheets.patches) +
           bytes_of(shape.sheets.crossings);
}

std::size_t bytes_of(const StageStart& start)
{
    std::size_t bytes = sizeof start;
    for (std::size_t r = 0; r < start.regions->size(); ++r)
        bytes += bytes_of((*start.regions)[r].samples) +
                 bytes_of((*start.regions)[r].listed) +
                 bytes_of(start.regions->voxels(r).runs());
    if (const Octree* const coarsest = start.refiner.coarsest())
        bytes += bytes_of(*coarsest);
    return bytes;
}

std::size_t bytes_of(const Checkpoint& state)
{
    std::size_t bytes =
        sizeof state + bytes_of(state.octree) + bytes_of(state.system.poses) +
        bytes_of(state.system.regions) + bytes_of(state.aims.regions) +
        bytes_of(state.aims.skeleton.turns) + bytes_of(state.aims.skeleton.shifts) +
        bytes_of(state.aims.skeleton.holds) + bytes_of(state.warnings);
    for (const RegionAim& aim : state.aims.regions)
        bytes += bytes_of(aim.steps) + bytes_of(aim.holds);
    for (const std::string& warning : state.warnings)
        bytes += warning.size();
    return bytes;
}

} // namespace

void Checkpoints::add(Checkpoint state)
{
    // What lay further on was undone: the next edit is another one.
    std::erase_if(states_,
                  [&](const Checkpoint& old) { return old.place >= state.place; });
    states_.push_back(std::move(state));
    thin();
}

const Checkpoint* Checkpoints::latest_on(const ScriptFingerprint& script) const
{
    for (std::size_t k = states_.size(); k-- > 0;)
        if (script.has(states_[k].place) &&
            script.up_to(states_[k].place) == states_[k].fingerprint)
            return &states_[k];
    return nullptr;
}

std::size_t Checkpoints::bytes() const
{
    // Those that share a stage, or its rest, lie one after the other.
    std::size_t bytes = 0;
    const StageStart* start = nullptr;
    const StageRest* rest = nullptr;
    for (const Checkpoint& state : states_)
    {
        bytes += bytes_of(state);
        if (!state.start)
            continue;
        if (state.start.get() != start)
            bytes += bytes_of(*state.start);
        if (state.start->rest.get() != rest)
            bytes += bytes_of(*state.start->rest);
        start = state.start.get();
        rest = state.start->rest.get();
    }
    return bytes;
}

void Checkpoints::thin()
{
    while (states_.size() > 2 &&
           (states_.size() > kMostCheckpoints || bytes() > most_bytes_))
    {
        // Of the older ones, that whose going widens a gap least for its age.
        std::size_t least = 0;
        double least_width = 0.0;
        const std::size_t now = states_.back().frames_done;
        const std::size_t end =
            states_.size() > kNewest + 1 ? states_.size() - kNewest : states_.size() - 1;
        for (std::size_t k = 0; k < end; ++k)
        {
            const std::size_t before = k == 0 ? 0 : states_[k - 1].frames_done;
            const double width =
                static_cast<double>(states_[k + 1].frames_done - before) /
                static_cast<double>(1 + now - states_[k].frames_done);
            if (k == 0 || width < least_width)
            {
                least = k;
                least_width = width;
            }
        }
        states_.erase(states_.begin() + static_cast<std::ptrdiff_t>(least));
    }
}

} // namespace cellwarp::core
