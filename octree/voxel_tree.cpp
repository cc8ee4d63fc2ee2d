// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/voxel_tree.h"

#include <algorithm>
#include <array>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Voxels that are few enough to look at one by one.
constexpr int kFewVoxelsOfNode = 8;

/// The least distance of different voxels: a search may end there.
constexpr std::int64_t kBeside = 1;

std::int64_t squared(const Eigen::Vector3i& step)
{
    return step.cast<std::int64_t>().squaredNorm();
}

/// Between blocks of voxels.
std::int64_t squared_distance(const Eigen::Vector3i& low_a, const Eigen::Vector3i& high_a,
                              const Eigen::Vector3i& low_b, const Eigen::Vector3i& high_b)
{
    return squared(
        (low_a - high_b).cwiseMax(low_b - high_a).cwiseMax(Eigen::Vector3i::Zero()));
}

} // namespace

VoxelTree::VoxelTree(std::vector<Eigen::Vector3i> voxels) : voxels_(std::move(voxels))
{
    nodes_.reserve(2 * voxels_.size() / kFewVoxelsOfNode + 1);
    build(0, static_cast<int>(voxels_.size()));
}

int VoxelTree::build(int begin, int end)
{
    const int node = static_cast<int>(nodes_.size());
    Eigen::Vector3i low = voxels_[idx(begin)], high = low;
    for (int k = begin; k < end; ++k)
    {
        low = low.cwiseMin(voxels_[idx(k)]);
        high = high.cwiseMax(voxels_[idx(k)]);
    }
    nodes_.push_back({low, high, begin, end});
    if (end - begin <= kFewVoxelsOfNode)
        return node;
    int axis = 0;
    (high - low).maxCoeff(&axis);
    const int middle = (begin + end) / 2;
    std::nth_element(voxels_.begin() + begin, voxels_.begin() + middle,
                     voxels_.begin() + end,
                     [axis](const Eigen::Vector3i& a, const Eigen::Vector3i& b)
                     {
                         for (int k = 0; k < 3; ++k)
                             if (const int at = (axis + k) % 3; a[at] != b[at])
                                 return a[at] < b[at];
                         return false;
                     });
    const int lower = build(begin, middle), upper = build(middle, end);
    nodes_[idx(node)].lower = lower;
    nodes_[idx(node)].upper = upper;
    return node;
}

std::int64_t VoxelTree::least_between_boxes(const VoxelTree& other) const
{
    return squared_distance(nodes_[0].low, nodes_[0].high, other.nodes_[0].low,
                            other.nodes_[0].high);
}

std::int64_t VoxelTree::nearest(const VoxelTree& other, std::int64_t most) const
{
    search(other, 0, 0, most);
    return most;
}

/// Lowers \p best to the least squared distance between two nodes.
void VoxelTree::search(const VoxelTree& other, int own, int of_other,
                       std::int64_t& best) const
{
    const Node& a = nodes_[idx(own)];
    const Node& b = other.nodes_[idx(of_other)];
    if (a.lower < 0 && b.lower < 0)
    {
        for (int i = a.begin; i < a.end; ++i)
            for (int k = b.begin; k < b.end; ++k)
                best = std::min(best, squared(voxels_[idx(i)] - other.voxels_[idx(k)]));
        return;
    }
    // The larger one is taken apart, and its nearer half looked at first.
    const bool is_own =
        b.lower < 0 || (a.lower >= 0 && a.end - a.begin > b.end - b.begin);
    std::array<std::pair<std::int64_t, int>, 2> halves;
    for (std::size_t k = 0; k < 2; ++k)
    {
        const Node& apart = is_own ? a : b;
        const int half = k == 0 ? apart.lower : apart.upper;
        const Node& one = is_own ? nodes_[idx(half)] : other.nodes_[idx(half)];
        const Node& whole = is_own ? b : a;
        halves[k] = {squared_distance(one.low, one.high, whole.low, whole.high), half};
    }
    std::sort(halves.begin(), halves.end());
    for (const auto& [least, half] : halves)
        if (least < best && best > kBeside)
            search(other, is_own ? half : own, is_own ? of_other : half, best);
}

std::int64_t VoxelTree::nearest(const Eigen::Vector3i& voxel, std::int64_t most,
                                std::vector<Eigen::Vector3i>& out) const
{
    out.clear();
    std::int64_t best = most;
    search(voxel, 0, best, out);
    return out.empty() ? most + 1 : best;
}

void VoxelTree::search(const Eigen::Vector3i& voxel, int node, std::int64_t& best,
                       std::vector<Eigen::Vector3i>& out) const
{
    const Node& own = nodes_[idx(node)];
    if (squared_distance(own.low, own.high, voxel, voxel) > best)
        return;
    if (own.lower >= 0)
    {
        search(voxel, own.lower, best, out);
        search(voxel, own.upper, best, out);
        return;
    }
    for (int k = own.begin; k < own.end; ++k)
    {
        const std::int64_t distance = squared(voxels_[idx(k)] - voxel);
        if (distance > best)
            continue;
        if (distance < best)
            out.clear();
        best = distance;
        out.push_back(voxels_[idx(k)]);
    }
}

} // namespace cellwarp::core
