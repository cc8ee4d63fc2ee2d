// SPDX-License-Identifier: GPL-3.0-or-later
// The distance of two components is that of the middles of their voxels, of which only
// those at the border of the material count. It is a whole number of voxels, squared: so
// ties are ties, whatever the direction, and whatever the octree.
//   A bridge stands on spots: voxels at the border of what is bridged that are at most
//   two
// voxels farther from the other component than the nearest one is. Each is a square of a
// voxel's area, half way to the nearest voxel of the other component; where several are
// equally near it is shared among them, so that a mirror image has the mirrored bridges.
// The spots between two cells are one bridge: x_f is the mean of their middles, the
// length that of their ways, at least a voxel, and
//   S = mean of (x - x_f)(x - x_f)^T + voxel^2 / 12 I,
// so that one spot alone holds the turn, too.
#include "octree/bridges.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/voxel_tree.h"

namespace cellwarp::core
{

namespace
{

/// Voxels that are no farther than this beyond the nearest one are spots [voxel].
constexpr double kSpotReach = 2.0;

constexpr std::int64_t kFarthest = std::numeric_limits<std::int64_t>::max();

/// Components that are worth a second thread.
constexpr std::size_t kFewComponents = 64;
constexpr std::size_t kFewVoxels = 64;

/// Whether nothing, or another material, is beside a voxel, or nothing between it and
/// that. Across a single layer of voxels there is no border.
bool is_at_border(const VoxelGrid& grid, const Notches& notches,
                  const Eigen::Vector3i& voxel, std::size_t index)
{
    const std::uint8_t own = grid.material()[index];
    std::size_t step = 1;
    for (int axis = 0; axis < 3; ++axis)
    {
        const int count = grid.counts()[axis], at = voxel[axis];
        if (count > 1 &&
            (at == 0 || at + 1 == count || grid.material()[index - step] != own ||
             grid.material()[index + step] != own || notches.is_open(index, axis) ||
             notches.is_open(index - step, axis)))
            return true;
        step *= idx(count);
    }
    return false;
}

/// The voxels at the border of each component.
std::vector<std::vector<Eigen::Vector3i>>
border_voxels(const VoxelGrid& grid, const Pieces& pieces, const Notches& notches,
              std::span<const int> component, std::size_t num_components)
{
    const Eigen::Vector3i& counts = grid.counts();
    std::vector<std::vector<std::pair<int, Eigen::Vector3i>>> of_layer(idx(counts.z()));
    parallel_for(of_layer.size(),
                 [&](std::size_t layer)
                 {
                     const int z = static_cast<int>(layer);
                     for (int y = 0; y < counts.y(); ++y)
                     {
                         const std::size_t row = grid.index(0, y, z);
                         for_each_set(grid.material(), row, row + idx(counts.x()),
                                      [&](std::size_t index)
                                      {
                                          const Eigen::Vector3i voxel(
                                              static_cast<int>(index - row), y, z);
                                          if (is_at_border(grid, notches, voxel, index))
                                              of_layer[layer].emplace_back(
                                                  component[idx(pieces.at(grid, voxel))],
                                                  voxel);
                                      });
                     }
                 });
    std::vector<std::vector<Eigen::Vector3i>> voxels(num_components);
    for (const auto& layer : of_layer)
        for (const auto& [number, voxel] : layer)
            voxels[idx(number)].push_back(voxel);
    return voxels;
}

using Trees = std::vector<std::optional<VoxelTree>>;

Trees trees_of(std::vector<std::vector<Eigen::Vector3i>> voxels)
{
    Trees trees(voxels.size());
    parallel_for(trees.size(),
                 [&](std::size_t k)
                 {
                     if (!voxels[k].empty())
                         trees[k].emplace(std::move(voxels[k]));
                 });
    return trees;
}

/// A component and the nearest one that it can go with.
struct Link
{
    std::size_t component = 0, to = 0;
    std::int64_t distance = kFarthest; ///< squared [voxel^2]
};

/// Prim's algorithm.
std::vector<Link> tree_of(const Trees& trees, const std::vector<bool>& is_held)
{
    std::vector<Link> left;
    for (std::size_t k = 0; k < trees.size(); ++k)
        if (!is_held[k] && trees[k])
            left.push_back({k});
    const auto offer = [&](std::size_t other)
    {
        parallel_for(
            left.size(), kFewComponents,
            [&](std::size_t k)
            {
                Link& link = left[k];
                const VoxelTree& own = *trees[link.component];
                const bool wins_tie = other < link.to;
                const std::int64_t least = own.least_between_boxes(*trees[other]);
                if (least > link.distance || (least == link.distance && !wins_tie))
                    return;
                const std::int64_t most =
                    link.distance == kFarthest ? kFarthest : link.distance + wins_tie;
                const std::int64_t found = own.nearest(*trees[other], most);
                if (found < most)
                    link = {link.component, other, found};
            });
    };
    for (std::size_t k = 0; k < trees.size(); ++k)
        if (is_held[k] && trees[k])
            offer(k);
    std::vector<Link> links;
    while (!left.empty())
    {
        // They stay sorted by component: of equal ones the first is taken.
        const auto next = std::min_element(left.begin(), left.end(),
                                           [](const Link& a, const Link& b)
                                           { return a.distance < b.distance; });
        if (next->distance == kFarthest)
            break; // nothing is held
        links.push_back(*next);
        left.erase(next);
        offer(links.back().component);
    }
    return links;
}

/// Sums over the spots between two cells.
struct Sums
{
    double share = 0.0, way = 0.0; ///< [voxel]
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    Eigen::Matrix3d second = Eigen::Matrix3d::Zero(); ///< about the first middle
    Eigen::Vector3d first = Eigen::Vector3d::Zero();

    void add(double part, double length, const Eigen::Vector3d& x)
    {
        if (share == 0.0)
            first = x;
        const Eigen::Vector3d from_first = x - first;
        share += part;
        way += part * length;
        middle += part * from_first;
        second += part * from_first * from_first.transpose();
    }
};

/// Those of one component, by the cells that they are between.
void add_bridges(const VoxelGrid& grid, const Pieces& pieces, const VoxelTree& own,
                 const VoxelTree& other, std::int64_t distance,
                 std::vector<Bridge>& bridges)
{
    const double reach = std::sqrt(static_cast<double>(distance)) + kSpotReach;
    const auto most = static_cast<std::int64_t>(reach * reach);
    std::vector<std::vector<Eigen::Vector3i>> nearest(own.voxels().size());
    parallel_for(nearest.size(), kFewVoxels,
                 [&](std::size_t k)
                 { other.nearest(own.voxels()[k], most, nearest[k]); });
    std::map<std::pair<int, int>, Sums> sums; // of two cells
    for (std::size_t k = 0; k < nearest.size(); ++k)
    {
        const Eigen::Vector3i& voxel = own.voxels()[k];
        const double part = 1.0 / static_cast<double>(nearest[k].size());
        for (const Eigen::Vector3i& there : nearest[k])
            sums[{pieces.at(grid, there), pieces.at(grid, voxel)}].add(
                part, (there - voxel).cast<double>().norm(),
                0.5 * (grid.centre(voxel) + grid.centre(there)));
    }
    const double voxel = grid.shape().voxel();
    for (const auto& [cells, sum] : sums)
    {
        Bridge& bridge = bridges.emplace_back();
        bridge.a = cells.first;
        bridge.b = cells.second;
        bridge.area = sum.share * voxel * voxel;
        bridge.length = std::max(1.0, sum.way / sum.share) * voxel;
        const Eigen::Vector3d mean = sum.middle / sum.share;
        bridge.centre = sum.first + mean;
        bridge.moment = sum.second / sum.share - mean * mean.transpose() +
                        voxel * voxel / 12.0 * Eigen::Matrix3d::Identity();
    }
}

} // namespace

Bridges find_bridges(const VoxelGrid& grid, const Pieces& pieces, const Notches& notches,
                     std::span<const int> component, const std::vector<bool>& is_held)
{
    Bridges bridges;
    if (std::count(is_held.begin(), is_held.end(), false) == 0 ||
        std::count(is_held.begin(), is_held.end(), true) == 0)
        return bridges;
    const Trees trees =
        trees_of(border_voxels(grid, pieces, notches, component, is_held.size()));
    for (const Link& link : tree_of(trees, is_held))
    {
        BridgedComponent& bridged = bridges.components.emplace_back();
        bridged.component = static_cast<int>(link.component);
        bridged.to = static_cast<int>(link.to);
        bridged.first = static_cast<int>(bridges.all.size());
        add_bridges(grid, pieces, *trees[link.component], *trees[link.to], link.distance,
                    bridges.all);
        bridged.end = static_cast<int>(bridges.all.size());
    }
    return bridges;
}

} // namespace cellwarp::core
