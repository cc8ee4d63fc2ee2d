// SPDX-License-Identifier: GPL-3.0-or-later
// The finer lattice stays as it is: its cells, their integrals, its hanging nodes. A node
// that leaves is at u = sum of its parents' shares + q, with q given in time; where all q
// are none, displacements are those of the coarser lattice, which then can take over.
#include "solver/flesh/leaving_nodes.h"

#include <array>
#include <map>

#include "octree/base/index.h"

namespace cellwarp::core
{

using Eigen::Vector3d;
using Eigen::Vector3i;

LeavingNodes let_leave(Lattice& fine, const Lattice& coarse,
                       std::span<const int> coarse_cell)
{
    const auto key = [](int cell, const Vector3i& place) {
        return std::array{cell, place.x(), place.y(), place.z()};
    };
    // The nodes inside of each coarse cell that do not hang, and one such cell of each,
    // with the place in it.
    std::map<std::array<int, 4>, int> node_at;
    std::vector<NodeHost> cell_of_node(fine.places.size());
    for (std::size_t c = 0; c < fine.cells.size(); ++c)
        for (int k = 0; k < 8; ++k)
        {
            const int node = fine.cells[c][idx(k)], cell = coarse_cell[c];
            const Vector3i place = corner_of(fine.boxes[c], k);
            if (cell_of_node[idx(node)].box < 0)
                cell_of_node[idx(node)] = {cell,
                                           place_in(coarse.boxes[idx(cell)], place)};
            if (fine.hanging[idx(node)].empty())
                node_at.emplace(key(cell, place), node);
        }
    std::vector<int> fine_of_coarse(coarse.places.size(), -1);
    for (std::size_t c = 0; c < coarse.cells.size(); ++c)
        for (int k = 0; k < 8; ++k)
            if (int& node = fine_of_coarse[idx(coarse.cells[c][idx(k)])]; node < 0)
                if (const auto found = node_at.find(
                        key(static_cast<int>(c), corner_of(coarse.boxes[c], k)));
                    found != node_at.end())
                    node = found->second;
    std::vector<char> stays(fine.places.size(), 0);
    for (std::size_t n = 0; n < coarse.places.size(); ++n)
    {
        int& node = fine_of_coarse[n];
        if (node < 0)
        {
            node = static_cast<int>(fine.places.size());
            fine.places.push_back(coarse.places[n]);
            fine.hanging.emplace_back();
            if (!fine.coarser.empty())
                fine.coarser.front().below.add(NodeShares());
        }
        else if (coarse.hanging[n].empty())
            stays[idx(node)] = 1;
    }
    LeavingNodes out;
    for (const CornerNodes& corners : coarse.cells)
    {
        CornerNodes& of_fine = out.coarse_cells.emplace_back();
        for (std::size_t k = 0; k < 8; ++k)
            of_fine[k] = fine_of_coarse[idx(corners[k])];
    }
    const auto leave = [&](int node, const NodeShares& coarse_shares)
    {
        NodeShares parents;
        for (const NodeShare& share : coarse_shares)
            parents.push_back({fine_of_coarse[idx(share.node)], share.share});
        out.nodes.push_back({node, gathered(std::move(parents))});
    };
    for (std::size_t n = 0; n < stays.size(); ++n)
    {
        if (stays[n] || !fine.hanging[n].empty() || cell_of_node[n].box < 0)
            continue;
        const auto& [cell, local] = cell_of_node[n];
        leave(static_cast<int>(n), shares_at(coarse, cell, local));
    }
    // What is of the coarser lattice alone may hang there.
    for (std::size_t n = 0; n < coarse.places.size(); ++n)
        if (const int node = fine_of_coarse[n];
            idx(node) >= stays.size() && !coarse.hanging[n].empty())
            leave(node, coarse.hanging[n]);
    return out;
}

Vector3d Fading::at(double time) const
{
    if (time >= end)
        return Vector3d::Zero();
    const double length = end - begin, y = (time - begin) / length;
    return (1.0 - y) * (1.0 - y) * ((1.0 + 2.0 * y) * from + y * length * slope);
}

} // namespace cellwarp::core
