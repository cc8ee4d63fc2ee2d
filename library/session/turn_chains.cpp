// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/turn_chains.h"

#include <algorithm>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// The shortest chain to region \p first from each one that is connected with it, found
/// from there outwards.
void add_chains(const Cells& cells, std::span<const int> region_of_cell, int first,
                std::vector<bool>& is_met, std::vector<std::vector<int>>& chains)
{
    const auto region_of = [&](int cell) { return region_of_cell[idx(cell)]; };
    std::vector<int> from(cells.size(), -1), queue;
    for (std::size_t c = 0; c < cells.size(); ++c)
        if (region_of_cell[c] == first)
        {
            from[c] = static_cast<int>(c);
            queue.push_back(static_cast<int>(c));
        }
    is_met[idx(first)] = true;
    for (std::size_t next = 0; next < queue.size(); ++next)
    {
        const int cell = queue[next], region = region_of(cell);
        if (region >= 0 && !is_met[idx(region)])
        {
            is_met[idx(region)] = true;
            std::vector<int>& chain = chains.emplace_back(1, cell);
            while (from[idx(chain.back())] != chain.back())
                chain.push_back(from[idx(chain.back())]);
        }
        for (const int other : cells.neighbours_of(cell))
            if (from[idx(other)] < 0)
            {
                from[idx(other)] = cell;
                queue.push_back(other);
            }
    }
}

} // namespace

TurnChains::TurnChains(const Cells& cells, std::span<const int> region_of_cell)
{
    const int most = region_of_cell.empty() ? -1
                                            : *std::max_element(region_of_cell.begin(),
                                                                region_of_cell.end());
    std::vector<bool> is_met(idx(most + 1), false);
    for (int region = 0; region <= most; ++region)
        if (!is_met[idx(region)])
            add_chains(cells, region_of_cell, region, is_met, chains_);
}

Eigen::Matrix3Xd TurnChains::turns(std::span<const Pose> poses) const
{
    Eigen::Matrix3Xd turns =
        Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(chains_.size()));
    for (std::size_t c = 0; c < chains_.size(); ++c)
    {
        const std::vector<int>& chain = chains_[c];
        for (std::size_t i = 1; i < chain.size(); ++i)
            turns.col(static_cast<Eigen::Index>(c)) += rotation_vector(
                poses[idx(chain[i])].R * poses[idx(chain[i - 1])].R.transpose());
    }
    return turns;
}

} // namespace cellwarp::core
