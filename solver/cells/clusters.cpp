// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/clusters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>

#include "octree/base/index.h"
#include "solver/cells/glue_distances.h"

namespace cellwarp::core
{

namespace
{

/// A core is small up to this share of a full block.
constexpr double kSmallCore = 0.25;

constexpr double kFar = std::numeric_limits<double>::infinity();

/// The number of the run that holds \p place when \p count places are cut into runs of
/// about \p length, as equal as can be and symmetric about the middle.
int symmetric_run(int place, int count, int length)
{
    int runs = std::max(1, static_cast<int>(std::lround(double(count) / length)));
    // A cut in the middle would have to go through its middle place.
    if (runs % 2 == 0 && count % 2 != 0)
        runs += runs * length < count ? 1 : -1;
    const auto first_of = [&](int run)
    {
        return 2 * run <= runs ? (2 * run * count + runs) / (2 * runs)
                               : count - (2 * (runs - run) * count + runs) / (2 * runs);
    };
    int run = 0;
    while (run + 1 < runs && place >= first_of(run + 1))
        ++run;
    return run;
}

using CellBlock = std::array<int, 4>; ///< size of its cells, run on each axis

/// The block of each cell.
std::vector<CellBlock> blocks_of(const Cells& cells, int length)
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
    std::vector<CellBlock> blocks;
    for (const Cell& cell : cells.cells)
    {
        const auto found = boxes.find(cell.edge);
        CellBlock& block = blocks.emplace_back();
        block[0] = static_cast<int>(std::distance(boxes.begin(), found));
        const Box& box = found->second;
        for (int axis = 0; axis < 3; ++axis)
        {
            const auto places = [&](double length_along)
            { return static_cast<int>(std::lround(length_along / cell.edge)); };
            block[idx(axis) + 1] =
                symmetric_run(places(cell.box_centre[axis] - box.low[axis]),
                              places(box.high[axis] - box.low[axis]) + 1, length);
        }
    }
    return blocks;
}

/// The cells of each block that are connected within it.
std::vector<std::vector<int>> cores_of(const Cells& cells,
                                       const std::vector<CellBlock>& blocks,
                                       const std::vector<bool>& is_left_out)
{
    std::vector<std::vector<int>> cores;
    std::vector<bool> is_taken = is_left_out;
    for (std::size_t first = 0; first < cells.size(); ++first)
    {
        if (is_taken[first])
            continue;
        is_taken[first] = true;
        std::vector<int>& core = cores.emplace_back();
        core.push_back(static_cast<int>(first));
        for (std::size_t next = 0; next < core.size(); ++next)
            for (const int other : cells.neighbours_of(core[next]))
                if (const std::size_t o = idx(other);
                    !is_taken[o] && blocks[o] == blocks[first])
                {
                    is_taken[o] = true;
                    core.push_back(other);
                }
        std::sort(core.begin(), core.end());
    }
    return cores;
}

/// Small cores, which cost a fit each, join the large one that most faces glue them to.
/// Where two are equal they stay alone: neither turning nor mirroring a shape may change
/// the choice.
std::vector<std::vector<int>>
joined_cores(const Cells& cells, std::vector<std::vector<int>> cores, int length)
{
    const std::size_t small =
        static_cast<std::size_t>(kSmallCore * length * length * length);
    std::vector<int> core_of(cells.size(), -1);
    for (std::size_t c = 0; c < cores.size(); ++c)
        for (const int cell : cores[c])
            core_of[idx(cell)] = static_cast<int>(c);
    std::vector<int> target(cores.size(), -1);
    for (std::size_t c = 0; c < cores.size(); ++c)
    {
        if (cores[c].size() > small)
            continue;
        std::map<int, int> faces; // to each large core
        for (const int cell : cores[c])
            for (const int other : cells.neighbours_of(cell))
                if (const int core = core_of[idx(other)];
                    core >= 0 && cores[idx(core)].size() > small)
                    ++faces[core];
        int most = 0, num_most = 0;
        for (const auto& [core, count] : faces)
        {
            num_most = count > most ? 1 : num_most + (count == most);
            if (count > most)
                target[c] = core;
            most = std::max(most, count);
        }
        if (num_most != 1)
            target[c] = -1;
    }
    std::vector<std::vector<int>> joined;
    for (std::size_t c = 0; c < cores.size(); ++c)
        if (target[c] >= 0)
        {
            std::vector<int>& core = cores[idx(target[c])];
            core.insert(core.end(), cores[c].begin(), cores[c].end());
        }
    for (std::size_t c = 0; c < cores.size(); ++c)
        if (target[c] < 0)
        {
            std::sort(cores[c].begin(), cores[c].end());
            joined.push_back(std::move(cores[c]));
        }
    return joined;
}

} // namespace

Clusters grow_clusters(const Cells& cells, const std::vector<bool>& is_left_out,
                       const ClusterSize& size)
{
    // Sums of steps of 1 must not miss a limit by their rounding.
    constexpr double kSlack = 1e-9;
    const std::vector<CellBlock> blocks = blocks_of(cells, size.core);
    Clusters result;
    for (std::vector<int>& core :
         joined_cores(cells, cores_of(cells, blocks, is_left_out), size.core))
        result.clusters.emplace_back().core = std::move(core);
    std::vector<std::vector<Membership>> of_cell(cells.size());
    // In edges, so that cells of all sizes count.
    const auto length = [](const Cell& from, const Cell& to)
    { return (to.box_centre - from.box_centre).norm() / (0.5 * (from.edge + to.edge)); };
    GlueDistances reach(cells);
    for (std::size_t c = 0; c < result.clusters.size(); ++c)
    {
        Cluster& cluster = result.clusters[c];
        reach.search(cluster.core, size.reach + kSlack, length);
        cluster.cells = reach.reached();
        std::sort(cluster.cells.begin(), cluster.cells.end());
        for (const int cell : cluster.cells)
            if (const double rest = 1.0 - reach.distance(cell) / size.support;
                rest > kSlack)
                of_cell[idx(cell)].push_back({static_cast<int>(c), rest * rest * rest});
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

} // namespace cellwarp::core
