// SPDX-License-Identifier: GPL-3.0-or-later
// Pairs of balls that are near each other, in time linear in the balls and the pairs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

class BallGrid
{
public:
    static constexpr std::size_t kAll = ~std::size_t(0);

    /// All pairs (i, j), i < j, that are apart by less than \p margin and that \p accepts
    /// takes (empty: all); where there are more than \p most, one more than that of
    /// them. Keeps its memory from one call to the next.
    const std::vector<std::pair<std::uint32_t, std::uint32_t>>&
    pairs(std::span<const Eigen::Vector3d> centres, std::span<const double> radii,
          double margin, std::size_t most = kAll,
          const std::function<bool(std::size_t, std::size_t)>& accepts = {});

private:
    struct Cell
    {
        std::int64_t x, y, z;
        int level;
        bool operator==(const Cell&) const = default;
    };
    std::vector<Cell> cells_;                 ///< of the balls
    std::vector<std::uint32_t> first_, next_; ///< lists of balls in the same bucket
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;
};

} // namespace cellwarp::core
