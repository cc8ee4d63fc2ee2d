// SPDX-License-Identifier: GPL-3.0-or-later
// A set of voxels of a grid (of up to 2^32), kept as runs that follow each other in
// memory: a box that is a hundred voxels long along x takes a fiftieth of its list, a
// sheet across x twice as much.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cellwarp::core
{

class VoxelRuns
{
public:
    /// The voxels [begin, end).
    struct Run
    {
        std::uint32_t begin = 0, end = 0;
    };

    VoxelRuns() = default;
    /// Of runs in any order, which may overlap or be empty.
    explicit VoxelRuns(std::vector<Run> runs);

    /// Adds the voxels [begin, end).
    /// \pre they are behind all that there are
    void add(std::size_t begin, std::size_t end)
    {
        assert(begin <= end && (empty() || runs_.back().end <= begin));
        if (begin == end)
            return;
        if (!runs_.empty() && runs_.back().end == begin)
            runs_.back().end = static_cast<std::uint32_t>(end);
        else
            runs_.push_back(
                {static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end)});
    }
    void add(std::size_t voxel) { add(voxel, voxel + 1); }

    bool empty() const { return runs_.empty(); }
    std::size_t num_voxels() const;
    bool has(std::size_t voxel) const;
    /// Ascending; none touches the next.
    const std::vector<Run>& runs() const { return runs_; }

    /// Calls visit(voxel) for all, ascending.
    template <class Visit>
    void for_each(Visit&& visit) const
    {
        for (const Run& run : runs_)
            for (std::size_t voxel = run.begin; voxel < run.end; ++voxel)
                visit(voxel);
    }
    /// Calls visit(from, to) for the parts of [begin, end) that belong to it, ascending.
    template <class Visit>
    void for_each_part(std::size_t begin, std::size_t end, Visit&& visit) const
    {
        for (std::size_t k = first_behind(begin);
             k < runs_.size() && runs_[k].begin < end; ++k)
            visit(std::max<std::size_t>(begin, runs_[k].begin),
                  std::min<std::size_t>(end, runs_[k].end));
    }

private:
    /// The first run that ends behind a voxel.
    std::size_t first_behind(std::size_t voxel) const;

    std::vector<Run> runs_;
};

/// What is in either.
VoxelRuns united(const VoxelRuns& a, const VoxelRuns& b);

} // namespace cellwarp::core
