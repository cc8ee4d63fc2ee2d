// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/voxel_runs.h"

#include <utility>

namespace cellwarp::core
{

VoxelRuns::VoxelRuns(std::vector<Run> runs) : runs_(std::move(runs))
{
    std::sort(runs_.begin(), runs_.end(),
              [](const Run& a, const Run& b) { return a.begin < b.begin; });
    std::size_t count = 0;
    for (const Run& run : runs_)
    {
        if (run.begin == run.end)
            continue;
        if (count > 0 && run.begin <= runs_[count - 1].end)
            runs_[count - 1].end = std::max(runs_[count - 1].end, run.end);
        else
            runs_[count++] = run;
    }
    runs_.resize(count);
}

std::size_t VoxelRuns::num_voxels() const
{
    std::size_t count = 0;
    for (const Run& run : runs_)
        count += run.end - run.begin;
    return count;
}

std::size_t VoxelRuns::first_behind(std::size_t voxel) const
{
    const auto first =
        std::upper_bound(runs_.begin(), runs_.end(), voxel,
                         [](std::size_t v, const Run& run) { return v < run.end; });
    return static_cast<std::size_t>(first - runs_.begin());
}

bool VoxelRuns::has(std::size_t voxel) const
{
    const std::size_t k = first_behind(voxel);
    return k < runs_.size() && runs_[k].begin <= voxel;
}

VoxelRuns united(const VoxelRuns& a, const VoxelRuns& b)
{
    if (b.empty())
        return a;
    std::vector<VoxelRuns::Run> runs = a.runs();
    runs.insert(runs.end(), b.runs().begin(), b.runs().end());
    return VoxelRuns(std::move(runs));
}

} // namespace cellwarp::core
