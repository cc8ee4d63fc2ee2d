// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/fragments.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
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

namespace
{

/// Voxels of material that follow each other along x.
struct MaterialRun
{
    std::size_t begin = 0, end = 0; ///< voxels
    std::int32_t part = 0;          ///< connected through sides, from 1
};

/// All runs inside the box, ascending; parts are numbered by their first voxels.
std::vector<MaterialRun> runs_in_parts(const VoxelGrid& grid)
{
    const VoxelRange& box = grid.inside_box();
    const std::size_t ny = idx(box.last.y() - box.first.y() + 1);
    const std::size_t nz = idx(box.last.z() - box.first.z() + 1);
    std::vector<std::vector<MaterialRun>> of_rows(ny * nz);
    parallel_for(of_rows.size(), 64,
                 [&](std::size_t row)
                 {
                     const std::size_t first = grid.index(
                         box.first.x(), box.first.y() + static_cast<int>(row % ny),
                         box.first.z() + static_cast<int>(row / ny));
                     const std::size_t end =
                         first + idx(box.last.x() - box.first.x() + 1);
                     std::vector<MaterialRun>& runs = of_rows[row];
                     for_each_set(grid.material(), first, end,
                                  [&](std::size_t voxel)
                                  {
                                      if (!runs.empty() && runs.back().end == voxel)
                                          ++runs.back().end;
                                      else
                                          runs.push_back({voxel, voxel + 1});
                                  });
                 });
    std::vector<MaterialRun> runs;
    std::vector<std::size_t> first_run; // of each row, and the end
    for (const std::vector<MaterialRun>& row : of_rows)
    {
        first_run.push_back(runs.size());
        runs.insert(runs.end(), row.begin(), row.end());
    }
    first_run.push_back(runs.size());
    UnionFind joined(runs.size());
    // \p step: from a voxel of the other row to that of this one.
    const auto join = [&](std::size_t row, std::size_t other, std::size_t step)
    {
        std::size_t a = first_run[row], b = first_run[other];
        while (a < first_run[row + 1] && b < first_run[other + 1])
        {
            if (runs[a].begin < runs[b].end + step && runs[b].begin + step < runs[a].end)
                joined.join(static_cast<int>(a), static_cast<int>(b));
            ++(runs[a].end < runs[b].end + step ? a : b);
        }
    };
    const std::size_t nx = idx(grid.counts().x());
    for (std::size_t row = 0; row < of_rows.size(); ++row)
    {
        if (row % ny != 0)
            join(row, row - 1, nx);
        if (row >= ny)
            join(row, row - ny, nx * idx(grid.counts().y()));
    }
    std::int32_t num_parts = 0;
    for (std::size_t k = 0; k < runs.size(); ++k)
    {
        const std::size_t root = idx(joined.first_of(static_cast<int>(k)));
        runs[k].part = root == k ? ++num_parts : runs[root].part;
    }
    return runs;
}

} // namespace

void join_fragments(VoxelGrid& grid, int reach)
{
    VoxelFlags& material = grid.material();
    const std::vector<MaterialRun> runs = runs_in_parts(grid);
    const std::int32_t num_parts = std::accumulate(runs.begin(), runs.end(), 0,
                                                   [](std::int32_t most, const auto& run)
                                                   { return std::max(most, run.part); });
    if (num_parts < 2)
        return;
    constexpr std::int32_t kFree = 0;
    VoxelValues<std::int32_t> part(grid.size());
    parallel_for(runs.size(), 64,
                 [&](std::size_t k)
                 {
                     for (std::size_t v = runs[k].begin; v < runs[k].end; ++v)
                         part[v] = runs[k].part;
                 });
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
    // The voxels of the parts beside others, ascending.
    std::vector<std::vector<std::size_t>> borders(runs.size());
    parallel_for(runs.size(), 64,
                 [&](std::size_t k)
                 {
                     for (std::size_t v = runs[k].begin; v < runs[k].end; ++v)
                     {
                         bool is_border = false;
                         for_neighbours(v, [&](std::size_t other)
                                        { is_border |= part[other] != part[v]; });
                         if (is_border)
                             borders[k].push_back(v);
                     }
                 });
    std::vector<std::size_t> front;
    for (const std::vector<std::size_t>& of_run : borders)
        front.insert(front.end(), of_run.begin(), of_run.end());
    // All parts grow at once; where two fronts meet there is a link, shortest first.
    struct Link
    {
        int length;
        std::size_t a, b;
    };
    std::vector<Link> links;
    VoxelValues<std::size_t> from(grid.size());
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
