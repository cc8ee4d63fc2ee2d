// SPDX-License-Identifier: GPL-3.0-or-later
// How far cells are from some of them, from centre to centre through the glue.
#pragma once

#include <functional>
#include <limits>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "octree/base/index.h"
#include "octree/cells.h"

namespace cellwarp::core
{

/// Of one search at a time; what was reached is known, so that the next search costs no
/// more than what it finds.
class GlueDistances
{
public:
    /// \p cells must outlive it.
    explicit GlueDistances(const Cells& cells)
        : cells_(cells), distance_(cells.size(), kFar)
    {
    }

    /// From \p first on, as far as \p limit; length(from, to) of neighbouring cells.
    template <class Length>
    void search(std::span<const int> first, double limit, const Length& length)
    {
        for (const int cell : reached_)
            distance_[idx(cell)] = kFar;
        reached_.clear();
        for (const int cell : first)
            offer(cell, 0.0);
        while (!queue_.empty())
        {
            const auto [d, cell] = queue_.top();
            queue_.pop();
            if (d > distance(cell))
                continue;
            const Cell& from = cells_.cells[idx(cell)];
            for (const int other : cells_.neighbours_of(cell))
                if (const double to = d + length(from, cells_.cells[idx(other)]);
                    to <= limit)
                    offer(other, to);
        }
    }
    double distance(int cell) const { return distance_[idx(cell)]; } ///< infinite: beyond
    const std::vector<int>& reached() const { return reached_; }

private:
    static constexpr double kFar = std::numeric_limits<double>::infinity();

    void offer(int cell, double d)
    {
        double& known = distance_[idx(cell)];
        if (d >= known)
            return;
        if (known == kFar)
            reached_.push_back(cell);
        known = d;
        queue_.emplace(d, cell);
    }

    using Entry = std::pair<double, int>;
    const Cells& cells_;
    std::vector<double> distance_;
    std::vector<int> reached_;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

} // namespace cellwarp::core
