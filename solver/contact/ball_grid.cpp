// SPDX-License-Identifier: GPL-3.0-or-later
// Balls of a size, within a factor of two, have cells of their own, as wide as two of
// them and the margin. A ball looks for partners of its own size and of larger ones, in
// the cell of that size where it is and the 26 around it; cells are in a table of buckets
// by a hash. Balls of other cells may share a bucket; they are left out by their cell, so
// that no pair comes twice.
#include "solver/contact/ball_grid.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

constexpr std::uint32_t kNone = ~std::uint32_t(0);

/// Of sizes 2^level up to twice that.
int level_of(double radius)
{
    return std::ilogb(radius);
}

double width_of(int level, double margin)
{
    return 4.0 * std::ldexp(1.0, level) + margin;
}

std::int64_t floored(double x)
{
    constexpr double kFar = 1e15;
    return static_cast<std::int64_t>(std::floor(std::clamp(x, -kFar, kFar)));
}

std::size_t bucket_of(std::int64_t x, std::int64_t y, std::int64_t z, int level,
                      std::size_t mask)
{
    std::uint64_t h = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15u;
    h = (h ^ static_cast<std::uint64_t>(y)) * 0xC2B2AE3D27D4EB4Fu;
    h = (h ^ static_cast<std::uint64_t>(z)) * 0x165667B19E3779F9u;
    h = (h ^ static_cast<std::uint64_t>(std::int64_t(level))) * 0x9E3779B97F4A7C15u;
    return static_cast<std::size_t>(h ^ (h >> 32)) & mask;
}

} // namespace

const std::vector<std::pair<std::uint32_t, std::uint32_t>>&
BallGrid::pairs(std::span<const Eigen::Vector3d> centres, std::span<const double> radii,
                double margin, std::size_t most,
                const std::function<bool(std::size_t, std::size_t)>& accepts)
{
    pairs_.clear();
    const std::size_t count = centres.size(), mask = std::bit_ceil(2 * count + 1) - 1;
    first_.assign(mask + 1, kNone);
    next_.assign(count, kNone);
    cells_.resize(count);
    const auto cell_of = [&](std::size_t ball, int level)
    {
        const double width = width_of(level, margin);
        const Eigen::Vector3d& x = centres[ball];
        return Cell{floored(x.x() / width), floored(x.y() / width),
                    floored(x.z() / width), level};
    };
    std::vector<int> levels;
    for (std::size_t i = 0; i < count; ++i)
    {
        const Cell cell = cells_[i] = cell_of(i, level_of(radii[i]));
        std::uint32_t& first =
            first_[bucket_of(cell.x, cell.y, cell.z, cell.level, mask)];
        next_[i] = first;
        first = static_cast<std::uint32_t>(i);
        if (std::find(levels.begin(), levels.end(), cell.level) == levels.end())
            levels.push_back(cell.level);
    }
    std::sort(levels.begin(), levels.end());
    for (std::size_t i = 0; i < count; ++i)
        for (const int level : levels)
        {
            const int own = cells_[i].level;
            if (level < own)
                continue;
            const Cell at = cell_of(i, level);
            for (std::int64_t x = at.x - 1; x <= at.x + 1; ++x)
                for (std::int64_t y = at.y - 1; y <= at.y + 1; ++y)
                    for (std::int64_t z = at.z - 1; z <= at.z + 1; ++z)
                        for (std::uint32_t j = first_[bucket_of(x, y, z, level, mask)];
                             j != kNone; j = next_[j])
                        {
                            // Of its own size the partners that came before.
                            if ((level == own && j >= i) ||
                                cells_[j] != Cell{x, y, z, level})
                                continue;
                            const double reach = radii[i] + radii[j] + margin;
                            if ((centres[i] - centres[j]).squaredNorm() >=
                                    reach * reach ||
                                (accepts && !accepts(i, j)))
                                continue;
                            pairs_.emplace_back(
                                std::min(j, static_cast<std::uint32_t>(i)),
                                std::max(j, static_cast<std::uint32_t>(i)));
                            if (pairs_.size() > most)
                                return pairs_;
                        }
        }
    return pairs_;
}

} // namespace cellwarp::core
