// SPDX-License-Identifier: GPL-3.0-or-later
// The place of a box along a curve that fills space: near boxes get near numbers.
#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace cellwarp::core
{

/// The bits of three numbers from 0 to 2^21 - 1, in turns.
inline std::uint64_t morton(const Eigen::Vector3i& v)
{
    const auto spread = [](int coordinate)
    {
        auto x = static_cast<std::uint64_t>(coordinate) & 0x1fffff;
        x = (x | x << 32) & 0x1f00000000ffff;
        x = (x | x << 16) & 0x1f0000ff0000ff;
        x = (x | x << 8) & 0x100f00f00f00f00f;
        x = (x | x << 4) & 0x10c30c30c30c30c3;
        return (x | x << 2) & 0x1249249249249249;
    };
    return spread(v.x()) | spread(v.y()) << 1 | spread(v.z()) << 2;
}

} // namespace cellwarp::core
