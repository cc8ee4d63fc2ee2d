// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/grouping.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Half of each coordinate, downwards.
Eigen::Vector3i halved(const Eigen::Vector3i& box)
{
    return {box.x() >> 1, box.y() >> 1, box.z() >> 1};
}

} // namespace

GridPlace grid_place(const Cells& cells, int cell)
{
    const Cell& one = cells.cells[idx(cell)];
    return {one.box_centre - cells.corner, one.edge};
}

std::vector<GridPlace> grid_places(const Cells& cells)
{
    std::vector<GridPlace> places;
    for (std::size_t c = 0; c < cells.size(); ++c)
        places.push_back(grid_place(cells, static_cast<int>(c)));
    return places;
}

Members::Members(std::span<const int> group_of_node, int count)
    : first(idx(count) + 1, 0), node(group_of_node.size())
{
    for (const int group : group_of_node)
        ++first[idx(group) + 1];
    for (std::size_t g = 1; g < first.size(); ++g)
        first[g] += first[g - 1];
    std::vector<int> next(first.begin(), first.end() - 1);
    for (std::size_t i = 0; i < group_of_node.size(); ++i)
        node[idx(next[idx(group_of_node[i])]++)] = static_cast<int>(i);
}

OctreeBlocks::OctreeBlocks(std::span<const GridPlace> places)
{
    double least = INFINITY;
    for (const GridPlace& place : places)
        least = std::min(least, place.edge);
    for (const GridPlace& place : places)
    {
        size_.push_back(static_cast<int>(std::lround(std::log2(place.edge / least))));
        box_.push_back(
            halved((place.box_centre / place.edge).array().floor().cast<int>().matrix()));
    }
}

bool OctreeBlocks::is_mixed() const
{
    for (std::size_t node = 0; node < size_.size(); ++node)
        if (is_waiting(node))
            return true;
    return false;
}

Grouping OctreeBlocks::join(const Links& links,
                            const std::function<bool(std::size_t, std::size_t)>& may_join)
{
    const std::size_t n = size_.size();
    std::vector<int> group(n, -1), heads;
    std::vector<std::size_t> queue;
    for (std::size_t head = 0; head < n; ++head)
    {
        if (group[head] >= 0)
            continue;
        const int own = static_cast<int>(heads.size());
        group[head] = own;
        queue.assign(1, head);
        for (std::size_t next = 0; next < queue.size(); ++next)
        {
            const std::size_t i = queue[next];
            for (std::size_t k = links.begin(i); k < links.end(i); ++k)
            {
                const std::size_t j = idx(links.column[k]);
                if (group[j] >= 0 || !is_one_block(i, j) || !may_join(i, k))
                    continue;
                group[j] = own;
                queue.push_back(j);
            }
        }
        heads.push_back(static_cast<int>(head));
    }
    std::vector<Eigen::Vector3i> boxes;
    std::vector<int> sizes;
    for (const int head : heads)
    {
        const std::size_t h = idx(head);
        const bool is_grown = size_[h] == level_;
        sizes.push_back(size_[h] + is_grown);
        boxes.push_back(is_grown ? halved(box_[h]) : box_[h]);
    }
    ++level_;
    box_ = std::move(boxes);
    size_ = std::move(sizes);
    Grouping grouping;
    grouping.members = Members(group, static_cast<int>(heads.size()));
    grouping.group_of_node = std::move(group);
    return grouping;
}

} // namespace cellwarp::core
