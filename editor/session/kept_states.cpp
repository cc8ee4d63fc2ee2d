// SPDX-License-Identifier: GPL-3.0-or-later
// Going back by one edit is what users do most, by many what they do rarely: the distance
// between kept states grows with their age, so that a few of them serve any length, and
// what has to be done again is at most about as long as the way back.
#include "editor/session/kept_states.h"

#include <algorithm>

namespace cellwarp
{

namespace
{

constexpr std::size_t kMostStates = 16;
/// The newest ones, which are never thinned out.
constexpr std::size_t kNewest = 6;
constexpr std::size_t kMostBytes = std::size_t(256) << 20;

std::size_t bytes_of(const KeptState& state)
{
    return state.rig.poses.size() * sizeof(Pose) +
           state.octree.leaves().size() * (sizeof(Leaf) + sizeof(std::uint64_t));
}

} // namespace

void KeptStates::add(KeptState state)
{
    // What lay further on was undone: the next edit is another one.
    std::erase_if(states_,
                  [&](const KeptState& old) { return old.place >= state.place; });
    states_.push_back(std::move(state));
    thin();
}

const KeptState* KeptStates::latest_on(const StatementChain& chain) const
{
    for (std::size_t k = states_.size(); k-- > 0;)
        if (chain.has(states_[k].place) &&
            chain.up_to(states_[k].place) == states_[k].print)
            return &states_[k];
    return nullptr;
}

void KeptStates::thin()
{
    std::size_t bytes = 0;
    for (const KeptState& state : states_)
        bytes += bytes_of(state);
    while (states_.size() > 2 && (states_.size() > kMostStates || bytes > kMostBytes))
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
        bytes -= bytes_of(states_[least]);
        states_.erase(states_.begin() + static_cast<std::ptrdiff_t>(least));
    }
}

} // namespace cellwarp
