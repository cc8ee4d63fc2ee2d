// SPDX-License-Identifier: GPL-3.0-or-later
// A point is known by its shares of the drawn vertices. All are whole multiples of powers
// of two, and so exact: points of two hexahedra are one point where their shares are the
// same, be it on a side, an edge or a corner. On a side the shares are of its own
// vertices alone, so the two need not be turned alike.
#include "solver/flesh/drawn_forest.h"

#include <algorithm>
#include <map>

#include "octree/base/index.h"

namespace cellwarp::core
{

using Eigen::Vector3d;
using Eigen::Vector3i;

/// The cells and nodes of an octree. A node's place is that in the first box of it.
struct DrawnForest::Level
{
    std::vector<LatticeBox> boxes;
    BoxNodes nodes;
    std::vector<NodeShares> of_vertices;
};

DrawnForest::DrawnForest(Hexahedra drawn, int max_depth)
    : drawn_(std::move(drawn)), roots_of_vertex_(drawn_.places.size())
{
    // Products of three numbers are exact down to this depth; and the octree is at most
    // so long.
    constexpr int kMostDepth = 16, kMostLong = 1 << 21;
    shape_.coarsest.x() = 2 * static_cast<int>(drawn_.cells.size());
    while (shape_.max_depth < std::min(max_depth, kMostDepth) &&
           shape_.coarsest.x() <= kMostLong >> (shape_.max_depth + 1))
        ++shape_.max_depth;
    for (std::size_t root = 0; root < drawn_.cells.size(); ++root)
        for (const int vertex : drawn_.cells[root])
            roots_of_vertex_[idx(vertex)].push_back(root);
}

MaterialTest DrawnForest::has_material() const
{
    return [this](const Leaf& leaf) { return leaf.corner.x() % gap() < gap() / 2; };
}

LatticeBox DrawnForest::box_of(std::size_t root) const
{
    return {Vector3i(gap() * static_cast<int>(root), 0, 0), gap() / 2};
}

DrawnForest::Place DrawnForest::place_in_leaf(const Octree& octree,
                                              const Place& of_root) const
{
    const LatticeBox root = box_of(of_root.cell);
    const Vector3d at = root.width * of_root.local;
    const Vector3d finest = at.array().floor().max(0.0).min(root.width - 1.0);
    const LeafNumber leaf = octree.find(root.corner + finest.cast<int>());
    const Vector3i from = octree[leaf].corner - root.corner;
    return {idx(leaf), (at - from.cast<double>()) / octree.width(octree[leaf])};
}

NodeShares DrawnForest::shares_at(std::size_t root, const Vector3d& place) const
{
    const LatticeBox box = box_of(root);
    const std::array<double, 8> shares =
        corner_shares((place - box.corner.cast<double>()) / box.width);
    NodeShares out;
    for (std::size_t k = 0; k < 8; ++k)
        out.push_back({drawn_.cells[root][k], shares[k]});
    return gathered(std::move(out));
}

std::vector<DrawnForest::Place> DrawnForest::touching(const Octree& octree,
                                                      const NodeShares& point) const
{
    std::map<LeafNumber, Vector3d> found;
    for (const std::size_t root : roots_of_vertex_[idx(point.front().node)])
    {
        const LatticeBox box = box_of(root);
        Vector3d place = box.corner.cast<double>();
        std::size_t num_shared = 0;
        for (std::size_t k = 0; k < 8; ++k)
            for (const NodeShare& share : point)
                if (share.node == drawn_.cells[root][k])
                {
                    ++num_shared;
                    place +=
                        box.width * share.share * Vector3d(k & 1, k >> 1 & 1, k >> 2);
                }
        if (num_shared != point.size() || shares_at(root, place) != point)
            continue;
        // On both sides where it lies between two finest boxes.
        for (int k = 0; k < 8; ++k)
        {
            const Vector3d beside =
                0.25 * Vector3d(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
            const Vector3d finest = (place + beside).array().floor();
            if (const LeafNumber leaf = octree.find(finest.cast<int>());
                leaf != LeafNumber::None)
                found.emplace(leaf, (place - octree[leaf].corner.cast<double>()) /
                                        octree.width(octree[leaf]));
        }
    }
    std::vector<Place> out;
    for (const auto& [leaf, local] : found)
        out.push_back({idx(leaf), local});
    return out;
}

DrawnForest::Level DrawnForest::level_of(const Octree& octree) const
{
    Level out;
    std::map<NodeShares, int> known;
    for (const Leaf& leaf : octree.leaves())
    {
        out.boxes.push_back({leaf.corner, octree.width(leaf)});
        CornerNodes& corners = out.nodes.of_box.emplace_back();
        for (int k = 0; k < 8; ++k)
        {
            const Vector3i place = corner_of(out.boxes.back(), k);
            const auto [node, is_new] =
                known.emplace(shares_at(root_of(leaf), place.cast<double>()),
                              static_cast<int>(out.nodes.places.size()));
            corners[idx(k)] = node->second;
            if (is_new)
            {
                out.nodes.places.push_back(place);
                out.of_vertices.push_back(node->first);
            }
        }
    }
    std::vector<NodeHost> hosts(out.nodes.places.size());
    for (std::size_t n = 0; n < hosts.size(); ++n)
        for (const auto& [cell, local] : touching(octree, out.of_vertices[n]))
            if ((local.array() != local.array().round()).any() && // no corner
                (hosts[n].box < 0 ||
                 out.boxes[cell].width > out.boxes[idx(hosts[n].box)].width))
                hosts[n] = {static_cast<int>(cell), local};
    hang_nodes(out.boxes, hosts, out.nodes);
    return out;
}

ForestLattice DrawnForest::lattice(const Octree& octree) const
{
    Level level = level_of(octree);
    std::vector<Vector3d> places;
    for (const NodeShares& shares : level.of_vertices)
    {
        places.emplace_back(Vector3d::Zero());
        for (const NodeShare& vertex : shares)
            places.back() += vertex.share * drawn_.places[idx(vertex.node)];
    }
    ForestLattice out{drawn_lattice(std::move(places), level.nodes.of_box,
                                    std::vector<int>(level.boxes.size(), 0)),
                      level.of_vertices};
    out.lattice.boxes = level.boxes;
    out.lattice.hanging = level.nodes.hanging;
    out.lattice.sides = sides(octree, out.lattice);
    Octree tree = octree;
    for (int depth = max_depth(); depth > 0; --depth)
    {
        std::vector<LeafNumber> smallest;
        for (const LeafNumber leaf : tree.numbers())
            if (tree[leaf].level == depth)
                smallest.push_back(leaf);
        if (smallest.empty())
            continue;
        tree = tree.merge(smallest);
        Level coarse = level_of(tree);
        std::vector<int> group;
        for (const LatticeBox& box : level.boxes)
            group.push_back(static_cast<int>(tree.find(box.corner)));
        out.lattice.coarser.push_back(
            {coarse.nodes.places.size(),
             rows_between(level.nodes, coarse.boxes, coarse.nodes, group)});
        level = std::move(coarse);
    }
    return out;
}

std::vector<CellSide> DrawnForest::sides(const Octree& octree,
                                         const Lattice& lattice) const
{
    const auto width = [&](int cell, int axis)
    { return cell_slopes(lattice, cell, Vector3d::Constant(0.5)).col(axis).norm(); };
    std::vector<CellSide> out;
    for (int cell = 0; cell < static_cast<int>(lattice.boxes.size()); ++cell)
        for (int side = 0; side < 6; ++side)
        {
            const LatticeBox& box = lattice.boxes[idx(cell)];
            Vector3d local = Vector3d::Constant(0.5);
            local[side / 2] = side % 2;
            for (const auto& [found, there] : touching(
                     octree, shares_at(root_of(octree.leaves()[idx(cell)]),
                                       box.corner.cast<double>() + box.width * local)))
            {
                const int other = static_cast<int>(found);
                const int larger = lattice.boxes[found].width - box.width;
                // Each pair once: by the smaller cell, or the first of two as large.
                if (larger < 0 || (larger == 0 && other <= cell))
                    continue;
                int axis = 0;
                while (there[axis] != 0.0 && there[axis] != 1.0)
                    ++axis;
                out.push_back({cell, other, width(cell, side / 2), width(other, axis)});
            }
        }
    return out;
}

} // namespace cellwarp::core
