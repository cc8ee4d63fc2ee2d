// SPDX-License-Identifier: GPL-3.0-or-later
// Which samples lie next to each other on the shape: along its faces, samples at one
// place being one; in a cloud the nearest ones.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Immutable.
class Neighbours
{
public:
    /// \p samples: rest places, in the order of \p geometry.
    Neighbours(const Geometry& geometry, std::span<const Eigen::Vector3d> samples);

    /// Of a sample that others share the place of: all samples there too, itself
    /// included.
    std::span<const std::uint32_t> of(std::size_t sample) const
    {
        const std::uint32_t spot = spots_[sample];
        return std::span(neighbours_)
            .subspan(first_[spot], first_[spot + 1] - first_[spot]);
    }

private:
    std::vector<std::uint32_t> spots_; ///< of each sample; samples at one place share it
    std::vector<std::uint64_t> first_; ///< of each spot, and the end
    std::vector<std::uint32_t> neighbours_;
};

} // namespace cellwarp::core
