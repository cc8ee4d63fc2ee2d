// SPDX-License-Identifier: GPL-3.0-or-later
// That hanging nodes follow the largest box which they touch gives the functions of
// [Yserentant86] whose details are left out there: along the sides of a box the values
// between its corners are means of means, which is to say trilinear.
#include "solver/flesh/box_nodes.h"

#include <algorithm>

#include "octree/base/union_find.h"

namespace cellwarp
{

namespace
{

using Eigen::Vector3d;
using Eigen::Vector3i;

Vector3i corner_of(const LatticeBox& box, int k)
{
    return box.corner + box.width * Vector3i(k & 1, k >> 1 & 1, k >> 2 & 1);
}

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

/// Shares of the nodes that do not hang; larger boxes come first, so that what their
/// corners take is known.
void resolve_hanging(std::span<const LatticeBox> boxes, std::span<const int> host_of_node,
                     BoxNodes& out)
{
    out.hanging.resize(out.places.size());
    std::vector<int> order;
    for (std::size_t n = 0; n < out.places.size(); ++n)
        if (host_of_node[n] >= 0)
            order.push_back(static_cast<int>(n));
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b)
                     {
                         return boxes[idx(host_of_node[idx(a)])].width >
                                boxes[idx(host_of_node[idx(b)])].width;
                     });
    for (const int node : order)
    {
        const std::size_t host = idx(host_of_node[idx(node)]);
        const Vector3d local =
            (out.places[idx(node)] - boxes[host].corner).cast<double>() /
            boxes[host].width;
        out.hanging[idx(node)] = shares_of(out.of_box[host], out.hanging, local);
    }
}

} // namespace

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
    UnionFind joined(8 * boxes.size());
    for (const auto& [a, b] : glued)
        for (int k = 0; k < 8; ++k)
            if (const int other = corner_at(boxes[idx(b)], corner_of(boxes[idx(a)], k));
                other >= 0)
                joined.join(8 * a + k, 8 * b + other);
    BoxNodes out;
    number_nodes(boxes, joined, out);
    std::vector<int> host_of_node(out.places.size(), -1);
    const auto hang = [&](int small, int large)
    {
        for (const int node : out.of_box[idx(small)])
        {
            const Vector3i& place = out.places[idx(node)];
            int& host = host_of_node[idx(node)];
            if (touches(boxes[idx(large)], place) &&
                corner_at(boxes[idx(large)], place) < 0 &&
                (host < 0 || boxes[idx(host)].width < boxes[idx(large)].width))
                host = large;
        }
    };
    for (const auto& [a, b] : glued)
        if (boxes[idx(a)].width < boxes[idx(b)].width)
            hang(a, b);
        else if (boxes[idx(b)].width < boxes[idx(a)].width)
            hang(b, a);
    resolve_hanging(boxes, host_of_node, out);
    return out;
}

} // namespace cellwarp
