// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/fragments.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/stop_scope.h"
#include "octree/base/union_find.h"
#include "octree/near_distances.h"

namespace cellwarp::core
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
    SparseStopCheck check(1024);
    for (std::size_t row = 0; row < of_rows.size(); ++row)
    {
        check();
        if (row % ny != 0)
            join(row, row - 1, nx);
        if (row >= ny)
            join(row, row - ny, nx * idx(grid.counts().y()));
    }
    check_stop();
    std::int32_t num_parts = 0;
    for (std::size_t k = 0; k < runs.size(); ++k)
    {
        const std::size_t root = idx(joined.first_of(static_cast<int>(k)));
        runs[k].part = root == k ? ++num_parts : runs[root].part;
    }
    return runs;
}

/// How much of the material is in each part.
struct PartSizes
{
    std::int32_t count = 0, largest = 0; ///< parts are numbered from 1
    std::size_t num_voxels = 0, num_beside_largest = 0;

    explicit PartSizes(const std::vector<MaterialRun>& runs)
    {
        for (const MaterialRun& run : runs)
            count = std::max(count, run.part);
        std::vector<std::size_t> sizes(idx(count) + 1, 0);
        for (const MaterialRun& run : runs)
        {
            sizes[idx(run.part)] += run.end - run.begin;
            num_voxels += run.end - run.begin;
        }
        const auto most = std::max_element(sizes.begin(), sizes.end());
        largest = static_cast<std::int32_t>(most - sizes.begin());
        num_beside_largest = num_voxels - *most;
    }
};

/// The voxels from which a way of at most \p reach voxels leads to another part than the
/// largest, and some more: all that joining fragments is about. In blocks of voxels.
class NearFragments
{
public:
    NearFragments(const VoxelGrid& grid, const std::vector<MaterialRun>& runs,
                  std::int32_t largest, int reach)
        : grid_(grid), edge_(std::max(8, reach)),
          counts_((grid.counts().array() + edge_ - 1) / edge_),
          is_near_(idx(counts_.x()) * idx(counts_.y()) * idx(counts_.z()), 0)
    {
        for (const MaterialRun& run : runs)
            if (run.part != largest)
            {
                const std::size_t first = block_of(grid_.coordinates(run.begin)),
                                  last = block_of(grid_.coordinates(run.end - 1));
                std::fill(is_near_.begin() + std::ptrdiff_t(first),
                          is_near_.begin() + std::ptrdiff_t(last) + 1, char{1});
            }
        // A block is as wide as the reach. What grows towards a fragment from as far away
        // as that may have begun as far again: two blocks on each side.
        for (int axis = 0; axis < 3; ++axis)
            for (int times = 0; times < 2; ++times)
                widen(axis);
    }
    bool contains(const Eigen::Vector3i& voxel) const
    {
        return is_near_[block_of(voxel)] != 0;
    }
    /// Calls visit(voxel) for those of a run, ascending.
    template <class Visit>
    void for_each_in(const MaterialRun& run, Visit&& visit) const
    {
        const Eigen::Vector3i first = grid_.coordinates(run.begin);
        const std::size_t row = run.begin - idx(first.x());
        for (std::size_t v = run.begin; v < run.end;)
        {
            const int x = static_cast<int>(v - row);
            const std::size_t end = std::min(run.end, row + idx((x / edge_ + 1) * edge_));
            if (contains({x, first.y(), first.z()}))
                for (; v < end; ++v)
                    visit(v);
            v = end;
        }
    }

private:
    std::size_t block_of(const Eigen::Vector3i& voxel) const
    {
        const Eigen::Vector3i block = voxel / edge_;
        return (idx(block.z()) * idx(counts_.y()) + idx(block.y())) * idx(counts_.x()) +
               idx(block.x());
    }
    /// By a block to both sides.
    void widen(int axis)
    {
        const std::size_t step = axis == 0   ? 1
                                 : axis == 1 ? idx(counts_.x())
                                             : idx(counts_.x()) * idx(counts_.y()),
                          count = idx(counts_[axis]);
        std::vector<char> wider = is_near_;
        for (std::size_t block = 0; block < is_near_.size(); ++block)
            if (is_near_[block])
            {
                const std::size_t at = block / step % count;
                if (at > 0)
                    wider[block - step] = 1;
                if (at + 1 < count)
                    wider[block + step] = 1;
            }
        is_near_ = std::move(wider);
    }

    const VoxelGrid& grid_;
    int edge_;
    Eigen::Vector3i counts_;
    std::vector<char> is_near_;
};

/// The shortest links between parts that join them.
class Links
{
public:
    Links(const VoxelGrid& grid, const std::vector<MaterialRun>& runs,
          const PartSizes& sizes, int reach)
        : grid_(grid), near_(grid, runs, sizes.largest, reach), part_(grid.size()),
          from_(grid.size()), joined_(idx(sizes.count) + 1), num_apart_(sizes.count)
    {
        std::vector<std::size_t> front = borders_of(runs);
        // All parts grow at once; where two fronts meet there is a link, shortest first.
        for (int distance = 0; distance <= reach / 2 && !front.empty() && num_apart_ > 1;
             ++distance)
            front = grown(front);
    }
    bool are_all_joined() const { return num_apart_ == 1; }
    void add_to(VoxelFlags& material) const
    {
        for (std::size_t voxel : ends_)
            for (; !material[voxel]; voxel = from_[voxel])
                material[voxel] = 1;
    }

private:
    static constexpr std::int32_t kFree = 0;

    template <class Visit>
    void for_neighbours(std::size_t voxel, Visit&& visit) const
    {
        for_each_beside(grid_.coordinates(voxel),
                        [&](const Eigen::Vector3i& other)
                        {
                            if (grid_.inside_box().contains(other) &&
                                near_.contains(other))
                                visit(grid_.index(other));
                        });
    }

    /// The voxels of the parts beside others, ascending.
    std::vector<std::size_t> borders_of(const std::vector<MaterialRun>& runs)
    {
        parallel_for(runs.size(), 64,
                     [&](std::size_t k) {
                         near_.for_each_in(runs[k], [&](std::size_t v)
                                           { part_[v] = runs[k].part; });
                     });
        std::vector<std::vector<std::size_t>> borders(runs.size());
        parallel_for(runs.size(), 64,
                     [&](std::size_t k)
                     {
                         near_.for_each_in(
                             runs[k],
                             [&](std::size_t v)
                             {
                                 bool is_border = false;
                                 for_neighbours(v,
                                                [&](std::size_t other) {
                                                    is_border |= part_[other] != part_[v];
                                                });
                                 if (is_border)
                                     borders[k].push_back(v);
                             });
                     });
        std::vector<std::size_t> front;
        for (const std::vector<std::size_t>& of_run : borders)
            front.insert(front.end(), of_run.begin(), of_run.end());
        return front;
    }

    std::vector<std::size_t> grown(const std::vector<std::size_t>& front)
    {
        std::vector<std::size_t> next;
        std::vector<std::pair<std::size_t, std::size_t>> meetings;
        SparseStopCheck check(4096);
        for (const std::size_t voxel : front)
        {
            check();
            for_neighbours(voxel,
                           [&](std::size_t other)
                           {
                               if (part_[other] == kFree)
                               {
                                   part_[other] = part_[voxel];
                                   from_[other] = voxel;
                                   next.push_back(other);
                               }
                               else if (part_[other] != part_[voxel])
                                   meetings.emplace_back(voxel, other);
                           });
        }
        for (const auto& [a, b] : meetings)
            if (joined_.join(part_[a], part_[b]))
            {
                --num_apart_;
                ends_.insert(ends_.end(), {a, b});
            }
        return next;
    }

    const VoxelGrid& grid_;
    NearFragments near_;
    VoxelValues<std::int32_t> part_;
    VoxelValues<std::size_t> from_; ///< where a part came from as it grew
    UnionFind joined_;
    std::int32_t num_apart_;
    std::vector<std::size_t> ends_; ///< of the links
};

} // namespace

void join_fragments(VoxelGrid& grid, int reach)
{
    const std::vector<MaterialRun> runs = runs_in_parts(grid);
    const PartSizes sizes(runs);
    if (sizes.count < 2)
        return;
    // Specks beside a body mostly lie close to it: all the way is looked at only where
    // that does not join them.
    constexpr std::size_t kSpecks = 64; ///< times as much as all of them
    constexpr int kClose = 8;
    const bool are_specks = sizes.num_beside_largest * kSpecks < sizes.num_voxels;
    for (int way = are_specks ? std::min(kClose, reach) : reach;;
         way = std::min(4 * way, reach))
    {
        const Links links(grid, runs, sizes, way);
        if (!links.are_all_joined() && way < reach)
            continue;
        links.add_to(grid.material());
        return;
    }
}

} // namespace cellwarp::core
