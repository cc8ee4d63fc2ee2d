// SPDX-License-Identifier: GPL-3.0-or-later
// Which samples lie next to each other on the shape: along its faces, samples at one
// place being one; in a cloud the nearest ones.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "io/geometry.h"

namespace cellwarp
{

/// Immutable.
class Neighbours
{
public:
    /// \p samples: rest places, in the order of \p geometry.
    Neighbours(const Geometry& geometry, std::span<const Eigen::Vector3d> samples);

    std::span<const std::uint32_t> of(std::size_t sample) const
    {
        return std::span(neighbours_)
            .subspan(first_[sample], first_[sample + 1] - first_[sample]);
    }

private:
    std::vector<std::uint64_t> first_; ///< samples + 1
    std::vector<std::uint32_t> neighbours_;
};

} // namespace cellwarp
