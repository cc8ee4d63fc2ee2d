// SPDX-License-Identifier: GPL-3.0-or-later
// Pairs of balls that are near each other, in time linear in the balls and the pairs.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace cellwarp
{

class BallGrid
{
public:
    /// All pairs (i, j), i < j, with centres nearer than \p reach, by j. Keeps its memory
    /// from one call to the next.
    const std::vector<std::pair<std::uint32_t, std::uint32_t>>&
    pairs(std::span<const Eigen::Vector3d> centres, double reach);

private:
    std::vector<std::int64_t> cell_;          ///< three a ball
    std::vector<std::uint32_t> first_, next_; ///< lists of balls in the same bucket
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;
};

} // namespace cellwarp
