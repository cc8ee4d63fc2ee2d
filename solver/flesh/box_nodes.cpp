// SPDX-License-Identifier: GPL-3.0-or-later
// That hanging nodes follow the largest box which they touch gives the functions of
// [Yserentant86] whose details are left out there: along the sides of a box the values
// between its corners are means of means, which is to say trilinear.
//
// Two boxes that touch along an edge alone are not glued. But where a small box is glued
// to both, and a corner of it lies on the middle of that edge, they must agree there:
// then they count as glued, too.
#include "solver/flesh/box_nodes.h"

#include <algorithm>
#include <iterator>
#include <set>

#include "octree/base/union_find.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::Vector3i;

/// The corner of a box at a place, or -1.
int corner_at(const LatticeBox& box, const Vector3i& place)
{
    const Vector3i from = place - box.corner;
    int k = 0;
    for (int axis = 0; axis < 3; ++axis)
        if (from[axis] == box.width)
            k |= 1 << axis;
        else if (from[axis] != 0)
            return -1;
    return k;
}

bool touches(const LatticeBox& box, const Vector3i& place)
{
    const Vector3i from = place - box.corner;
    return (from.array() >= 0).all() && (from.array() <= box.width).all();
}

/// Numbers nodes in the order of their first corners.
void number_nodes(std::span<const LatticeBox> boxes, UnionFind& joined, BoxNodes& out)
{
    std::vector<int> number(8 * boxes.size(), -1);
    out.of_box.resize(boxes.size());
    for (std::size_t b = 0; b < boxes.size(); ++b)
        for (int k = 0; k < 8; ++k)
        {
            int& node = number[idx(joined.first_of(static_cast<int>(8 * b) + k))];
            if (node < 0)
            {
                node = static_cast<int>(out.places.size());
                out.places.push_back(corner_of(boxes[b], k));
            }
            out.of_box[b][idx(k)] = node;
        }
}

void join_corners(std::span<const LatticeBox> boxes,
                  const std::set<std::pair<int, int>>& pairs, UnionFind& joined)
{
    for (const auto& [a, b] : pairs)
        for (int k = 0; k < 8; ++k)
            if (const int other = corner_at(boxes[idx(b)], corner_of(boxes[idx(a)], k));
                other >= 0)
                joined.join(8 * a + k, 8 * b + other);
}

/// The larger boxes on whose sides each node lies.
std::vector<std::set<int>> hosts_of_nodes(std::span<const LatticeBox> boxes,
                                          const std::set<std::pair<int, int>>& pairs,
                                          const BoxNodes& nodes)
{
    std::vector<std::set<int>> hosts(nodes.places.size());
    const auto hang = [&](int small, int large)
    {
        for (const int node : nodes.of_box[idx(small)])
        {
            const Vector3i& place = nodes.places[idx(node)];
            if (touches(boxes[idx(large)], place) &&
                corner_at(boxes[idx(large)], place) < 0)
                hosts[idx(node)].insert(large);
        }
    };
    for (const auto& [a, b] : pairs)
        if (boxes[idx(a)].width < boxes[idx(b)].width)
            hang(a, b);
        else if (boxes[idx(b)].width < boxes[idx(a)].width)
            hang(b, a);
    return hosts;
}

} // namespace

Vector3i corner_of(const LatticeBox& box, int k)
{
    return box.corner + box.width * Vector3i(k & 1, k >> 1 & 1, k >> 2 & 1);
}

Vector3d place_in(const LatticeBox& box, const Vector3i& place)
{
    return (place - box.corner).cast<double>() / box.width;
}

std::array<double, 8> corner_shares(const Vector3d& local)
{
    std::array<double, 8> shares{};
    for (int k = 0; k < 8; ++k)
        shares[idx(k)] = (k & 1 ? local.x() : 1.0 - local.x()) *
                         (k & 2 ? local.y() : 1.0 - local.y()) *
                         (k & 4 ? local.z() : 1.0 - local.z());
    return shares;
}

NodeShares shares_of(const CornerNodes& corners, std::span<const NodeShares> hanging,
                     const Vector3d& local)
{
    const std::array<double, 8> shares = corner_shares(local);
    NodeShares row;
    for (std::size_t k = 0; k < 8; ++k)
    {
        const NodeShares& followed = hanging[idx(corners[k])];
        if (followed.empty())
            row.push_back({corners[k], shares[k]});
        for (const NodeShare& share : followed)
            row.push_back({share.node, shares[k] * share.share});
    }
    return gathered(std::move(row));
}

BoxNodes box_nodes(std::span<const LatticeBox> boxes,
                   std::span<const std::pair<int, int>> glued)
{
    std::set<std::pair<int, int>> pairs(glued.begin(), glued.end());
    UnionFind joined(8 * boxes.size());
    std::size_t known = 0;
    BoxNodes out;
    std::vector<std::set<int>> hosts; // of each node
    // What is joined grows until nothing gapes.
    while (pairs.size() > known)
    {
        known = pairs.size();
        join_corners(boxes, pairs, joined);
        out = {};
        number_nodes(boxes, joined, out);
        hosts = hosts_of_nodes(boxes, pairs, out);
        for (const std::set<int>& of_node : hosts)
            for (auto a = of_node.begin(); a != of_node.end(); ++a)
                for (auto b = std::next(a); b != of_node.end(); ++b)
                    pairs.emplace(*a, *b);
    }
    if (pairs.empty())
    {
        number_nodes(boxes, joined, out);
        hosts.resize(out.places.size());
    }
    std::vector<NodeHost> host_of_node;
    for (std::size_t n = 0; n < hosts.size(); ++n)
    {
        const auto largest = std::max_element(
            hosts[n].begin(), hosts[n].end(),
            [&](int a, int b) { return boxes[idx(a)].width < boxes[idx(b)].width; });
        NodeHost& host = host_of_node.emplace_back();
        if (largest == hosts[n].end())
            continue;
        host.box = *largest;
        host.local = place_in(boxes[idx(host.box)], out.places[n]);
    }
    hang_nodes(boxes, host_of_node, out);
    return out;
}

void hang_nodes(std::span<const LatticeBox> boxes, std::span<const NodeHost> hosts,
                BoxNodes& nodes)
{
    nodes.hanging.resize(hosts.size());
    std::vector<int> order;
    for (std::size_t n = 0; n < hosts.size(); ++n)
        if (hosts[n].box >= 0)
            order.push_back(static_cast<int>(n));
    // Larger boxes come first, so that what their corners take is known.
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) {
                         return boxes[idx(hosts[idx(a)].box)].width >
                                boxes[idx(hosts[idx(b)].box)].width;
                     });
    for (const int node : order)
    {
        const NodeHost& host = hosts[idx(node)];
        nodes.hanging[idx(node)] =
            shares_of(nodes.of_box[idx(host.box)], nodes.hanging, host.local);
    }
}

SparseRows rows_between(const BoxNodes& fine, std::span<const LatticeBox> boxes,
                        const BoxNodes& coarse, std::span<const int> group)
{
    std::vector<int> box_of_node(fine.places.size(), -1);
    for (std::size_t b = 0; b < fine.of_box.size(); ++b)
        for (const int node : fine.of_box[b])
            if (box_of_node[idx(node)] < 0)
                box_of_node[idx(node)] = static_cast<int>(b);
    SparseRows rows;
    for (std::size_t n = 0; n < box_of_node.size(); ++n)
    {
        NodeShares row;
        if (fine.hanging[n].empty())
        {
            const std::size_t b = idx(group[idx(box_of_node[n])]);
            row = shares_of(coarse.of_box[b], coarse.hanging,
                            place_in(boxes[b], fine.places[n]));
        }
        rows.add(row);
    }
    return rows;
}

} // namespace cellwarp::core
