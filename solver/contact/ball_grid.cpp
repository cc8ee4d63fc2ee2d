// SPDX-License-Identifier: GPL-3.0-or-later
// Cells as wide as the reach, in a table of buckets by a hash: partners of a ball are in
// its own cell and the 26 around it. Balls of other cells may share the bucket; they are
// left out by their cell, so that no pair comes twice.
#include "solver/contact/ball_grid.h"

#include <bit>
#include <cmath>

#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

constexpr std::uint32_t kNone = ~std::uint32_t(0);

std::size_t bucket_of(std::int64_t x, std::int64_t y, std::int64_t z, std::size_t mask)
{
    std::uint64_t h = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15u;
    h = (h ^ static_cast<std::uint64_t>(y)) * 0xC2B2AE3D27D4EB4Fu;
    h = (h ^ static_cast<std::uint64_t>(z)) * 0x165667B19E3779F9u;
    return static_cast<std::size_t>(h ^ (h >> 32)) & mask;
}

} // namespace

const std::vector<std::pair<std::uint32_t, std::uint32_t>>&
BallGrid::pairs(std::span<const Eigen::Vector3d> centres, double reach)
{
    pairs_.clear();
    const std::size_t count = centres.size(), mask = std::bit_ceil(2 * count + 1) - 1;
    first_.assign(mask + 1, kNone);
    next_.assign(count, kNone);
    cell_.resize(3 * count);
    for (std::size_t i = 0; i < count; ++i)
    {
        for (std::size_t c = 0; c < 3; ++c)
            cell_[3 * i + c] = static_cast<std::int64_t>(
                std::floor(centres[i][static_cast<Eigen::Index>(c)] / reach));
        const std::int64_t* const at = &cell_[3 * i];
        // Partners that came before.
        for (std::int64_t x = at[0] - 1; x <= at[0] + 1; ++x)
            for (std::int64_t y = at[1] - 1; y <= at[1] + 1; ++y)
                for (std::int64_t z = at[2] - 1; z <= at[2] + 1; ++z)
                    for (std::uint32_t j = first_[bucket_of(x, y, z, mask)]; j != kNone;
                         j = next_[j])
                    {
                        const std::int64_t* const of = &cell_[3 * std::size_t(j)];
                        if (of[0] == x && of[1] == y && of[2] == z &&
                            (centres[i] - centres[j]).squaredNorm() < reach * reach)
                            pairs_.emplace_back(j, static_cast<std::uint32_t>(i));
                    }
        std::uint32_t& first = first_[bucket_of(at[0], at[1], at[2], mask)];
        next_[i] = first;
        first = static_cast<std::uint32_t>(i);
    }
    return pairs_;
}

} // namespace cellwarp
