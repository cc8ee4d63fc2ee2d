// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/fragments.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "octree/base/index.h"
#include "octree/base/union_find.h"
#include "octree/distance_transform.h"

namespace cellwarp
{

void spread(VoxelGrid& grid, const VoxelFlags& marks, double r)
{
    const NearDistances distances(marks, grid.counts(), r);
    const VoxelRange& box = grid.inside_box();
    const std::size_t first = idx(box.first.x()), last = idx(box.last.x());
    for (int k = box.first.z(); k <= box.last.z(); ++k)
        for (int j = box.first.y(); j <= box.last.y(); ++j)
        {
            const std::size_t row = grid.index(0, j, k);
            distances.for_each_near(row / idx(grid.counts().x()),
                                    [&](std::size_t x)
                                    {
                                        if (x >= first && x <= last)
                                            grid.material()[row + x] = 1;
                                    });
        }
}

void join_fragments(VoxelGrid& grid, int reach)
{
    VoxelFlags& material = grid.material();
    constexpr std::int32_t kFree = 0; // parts are numbered from 1
    VoxelValues<std::int32_t> part(grid.size());
    const auto for_neighbours = [&](std::size_t voxel, auto&& visit)
    {
        const Eigen::Vector3i place = grid.coordinates(voxel);
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1})
            {
                Eigen::Vector3i other = place;
                other[axis] += step;
                if (grid.inside_box().contains(other))
                    visit(grid.index(other));
            }
    };
    std::int32_t num_parts = 0;
    std::vector<std::size_t> front;
    const auto find_part = [&](std::size_t seed)
    {
        if (part[seed] != kFree)
            return;
        part[seed] = ++num_parts;
        std::vector<std::size_t> stack = {seed};
        while (!stack.empty())
        {
            const std::size_t voxel = stack.back();
            stack.pop_back();
            front.push_back(voxel);
            for_neighbours(voxel,
                           [&](std::size_t other)
                           {
                               if (material[other] && part[other] == kFree)
                               {
                                   part[other] = num_parts;
                                   stack.push_back(other);
                               }
                           });
        }
    };
    for_each_set(material, find_part);
    if (num_parts < 2)
        return;
    // All parts grow at once; where two fronts meet there is a link, shortest first.
    struct Link
    {
        int length;
        std::size_t a, b;
    };
    std::vector<Link> links;
    VoxelValues<std::size_t> from(grid.size());
    for (const std::size_t voxel : front)
        from[voxel] = voxel;
    std::sort(front.begin(), front.end());
    for (int distance = 0; distance <= reach / 2 && !front.empty(); ++distance)
    {
        std::vector<std::size_t> next;
        for (const std::size_t voxel : front)
            for_neighbours(voxel,
                           [&](std::size_t other)
                           {
                               if (part[other] == kFree)
                               {
                                   part[other] = part[voxel];
                                   from[other] = voxel;
                                   next.push_back(other);
                               }
                               else if (part[other] != part[voxel])
                                   links.push_back({2 * distance, voxel, other});
                           });
        front = std::move(next);
    }
    std::stable_sort(links.begin(), links.end(),
                     [](const Link& a, const Link& b) { return a.length < b.length; });
    UnionFind joined(idx(num_parts) + 1);
    for (const Link& link : links)
    {
        if (!joined.join(part[link.a], part[link.b]))
            continue;
        for (std::size_t voxel : {link.a, link.b})
            for (; !material[voxel]; voxel = from[voxel])
                material[voxel] = 1;
    }
}

} // namespace cellwarp
