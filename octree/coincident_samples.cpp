// SPDX-License-Identifier: GPL-3.0-or-later
// Samples are sorted by a hash of the grid cell that holds them. Cells are far larger
// than the tolerance: only a place within it of a cell's border must look into the next
// cell. Different cells of one hash do no harm, since distances are looked at in any
// case.
#include "octree/coincident_samples.h"

#include <algorithm>
#include <cmath>

#include "octree/base/hash.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Edge of a cell [tolerance].
constexpr double kCell = 1024.0;

} // namespace

CoincidentSamples::CoincidentSamples(const std::vector<Eigen::Vector3d>& samples,
                                     double tolerance)
    : samples_(samples), tolerance_(tolerance), hashes_(samples.size())
{
    parallel_ranges(samples.size(), 4096,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            hashes_[i] = {hash_of(cell_of(samples[i])),
                                          static_cast<std::uint32_t>(i)};
                    });
    parallel_sort(hashes_);
}

CoincidentSamples::Cell CoincidentSamples::cell_of(const Eigen::Vector3d& x) const
{
    return tolerance_ > 0 ? Cell((x / (kCell * tolerance_)).array().floor()) : x;
}

void CoincidentSamples::gather_in(const Cell& cell, const Eigen::Vector3d& x,
                                  std::vector<std::uint32_t>& all) const
{
    const std::uint64_t hash = hash_of(cell);
    for (auto at = std::lower_bound(hashes_.begin(), hashes_.end(),
                                    std::pair(hash, std::uint32_t(0)));
         at != hashes_.end() && at->first == hash; ++at)
        if ((samples_[at->second] - x).norm() <= tolerance_)
            all.push_back(at->second);
}

void CoincidentSamples::gather(const Eigen::Vector3d& x,
                               std::vector<std::uint32_t>& all) const
{
    const Cell low = cell_of(x - Cell::Constant(tolerance_));
    const Cell high = cell_of(x + Cell::Constant(tolerance_));
    for (int corner = 0; corner < 8; ++corner)
    {
        Cell cell = low;
        bool is_new = true;
        for (int axis = 0; axis < 3; ++axis)
            if (corner >> axis & 1)
            {
                is_new &= high[axis] != low[axis];
                cell[axis] = high[axis];
            }
        if (is_new)
            gather_in(cell, x, all);
    }
}

std::vector<std::uint32_t>
CoincidentSamples::of(std::span<const std::uint32_t> listed) const
{
    std::vector<std::uint32_t> all;
    std::vector<bool> is_done(samples_.size(), false);
    for (const std::uint32_t i : listed)
    {
        if (is_done[i])
            continue;
        const std::size_t first = all.size();
        gather(samples_[i], all);
        // Those at the very same place coincide with the same samples.
        for (std::size_t k = first; k < all.size(); ++k)
            if (samples_[all[k]] == samples_[i])
                is_done[all[k]] = true;
    }
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
}

} // namespace cellwarp::core
