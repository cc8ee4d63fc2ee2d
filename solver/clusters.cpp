// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/clusters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <queue>

namespace cellwarp
{

namespace
{

constexpr double kFar = std::numeric_limits<double>::infinity();

/// Distances from one core at a time; what was reached is known, so that a search
/// costs no more than what it finds.
class Reach
{
public:
    explicit Reach(const Cells& cells) : cells_(cells), distance_(cells.size(), kFar) {}

    void search(std::span<const int> core, double limit)
    {
        for (const int cell : reached_)
            distance_[static_cast<std::size_t>(cell)] = kFar;
        reached_.clear();
        for (const int cell : core)
            offer(cell, 0.0);
        while (!queue_.empty())
        {
            const auto [d, cell] = queue_.top();
            queue_.pop();
            if (d > distance(cell))
                continue;
            const Cell& from = cells_.cells[static_cast<std::size_t>(cell)];
            for (const int other : cells_.neighbours_of(cell))
            {
                const Cell& to = cells_.cells[static_cast<std::size_t>(other)];
                const double step = (to.box_centre - from.box_centre).norm() /
                                    (0.5 * (from.edge + to.edge));
                if (d + step <= limit)
                    offer(other, d + step);
            }
        }
    }
    double distance(int cell) const { return distance_[static_cast<std::size_t>(cell)]; }
    const std::vector<int>& reached() const { return reached_; }

private:
    void offer(int cell, double d)
    {
        double& known = distance_[static_cast<std::size_t>(cell)];
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

/// The number of the run that holds \p place when \p count places are cut into runs of
/// \p length, symmetrically: from the middle outwards, the last ones may be shorter.
/// Runs of one side are negative.
int symmetric_run(int place, int count, int length)
{
    // Twice the distance from the middle: odd if there is no middle place.
    const int twice = 2 * place - (count - 1), out = std::abs(twice) / 2;
    int run = out / length + 1;
    if (count % 2 != 0)
    {
        // The run in the middle is as long on both sides of its middle place.
        const int half = length / 2;
        run = out <= half ? 0 : (out - half - 1) / length + 1;
    }
    return twice < 0 ? -run : run;
}

using Block = std::array<int, 4>; ///< size of its cells, run on each axis

/// The block of each cell.
std::vector<Block> blocks_of(const Cells& cells, int length)
{
    struct Box
    {
        Eigen::Vector3d low = Eigen::Vector3d::Constant(kFar);
        Eigen::Vector3d high = Eigen::Vector3d::Constant(-kFar);
    };
    std::map<double, Box> boxes; // by edge
    for (const Cell& cell : cells.cells)
    {
        Box& box = boxes[cell.edge];
        box.low = box.low.cwiseMin(cell.box_centre);
        box.high = box.high.cwiseMax(cell.box_centre);
    }
    std::vector<Block> blocks;
    for (const Cell& cell : cells.cells)
    {
        const auto found = boxes.find(cell.edge);
        Block& block = blocks.emplace_back();
        block[0] = static_cast<int>(std::distance(boxes.begin(), found));
        const Box& box = found->second;
        for (int axis = 0; axis < 3; ++axis)
        {
            const auto places = [&](double length_along)
            { return static_cast<int>(std::lround(length_along / cell.edge)); };
            block[static_cast<std::size_t>(axis) + 1] =
                symmetric_run(places(cell.box_centre[axis] - box.low[axis]),
                              places(box.high[axis] - box.low[axis]) + 1, length);
        }
    }
    return blocks;
}

} // namespace

Clusters grow_clusters(const Cells& cells, const std::vector<bool>& is_left_out,
                       const ClusterSize& size)
{
    // Sums of steps of 1 must not miss a limit by their rounding.
    constexpr double kSlack = 1e-9;
    const std::vector<Block> blocks = blocks_of(cells, size.core);
    Clusters result;
    std::vector<bool> is_taken = is_left_out;
    for (std::size_t first = 0; first < cells.size(); ++first)
    {
        if (is_taken[first])
            continue;
        is_taken[first] = true;
        std::vector<int>& core = result.clusters.emplace_back().core;
        core.push_back(static_cast<int>(first));
        for (std::size_t next = 0; next < core.size(); ++next)
            for (const int other : cells.neighbours_of(core[next]))
                if (const std::size_t o = static_cast<std::size_t>(other);
                    !is_taken[o] && blocks[o] == blocks[first])
                {
                    is_taken[o] = true;
                    core.push_back(other);
                }
        std::sort(core.begin(), core.end());
    }
    std::vector<std::vector<Membership>> of_cell(cells.size());
    Reach reach(cells);
    for (std::size_t c = 0; c < result.clusters.size(); ++c)
    {
        Cluster& cluster = result.clusters[c];
        reach.search(cluster.core, size.reach + kSlack);
        cluster.cells = reach.reached();
        std::sort(cluster.cells.begin(), cluster.cells.end());
        for (const int cell : cluster.cells)
            if (const double rest = 1.0 - reach.distance(cell) / size.support;
                rest > kSlack)
                of_cell[static_cast<std::size_t>(cell)].push_back(
                    {static_cast<int>(c), rest * rest * rest});
    }
    result.first_membership.push_back(0);
    for (const std::vector<Membership>& memberships : of_cell)
    {
        result.memberships.insert(result.memberships.end(), memberships.begin(),
                                  memberships.end());
        result.first_membership.push_back(static_cast<int>(result.memberships.size()));
    }
    return result;
}

} // namespace cellwarp
