// SPDX-License-Identifier: GPL-3.0-or-later
// Samples at one place: what is done to one of them is meant for all.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "editor/session/work_frame.h"

namespace cellwarp
{

/// Immutable. Keeps a reference to the samples.
class CoincidentSamples
{
public:
    /// Samples coincide that lie within 1e-9 of the diagonal of \p box.
    CoincidentSamples(const std::vector<Eigen::Vector3d>& samples, const ModelBox& box);

    /// The listed samples and all that coincide with them, ascending.
    std::vector<std::uint32_t> of(std::span<const std::uint32_t> listed) const;

private:
    using Cell = Eigen::Vector3d; ///< whole numbers

    Cell cell_of(const Eigen::Vector3d& x) const;
    void gather(const Eigen::Vector3d& x, std::vector<std::uint32_t>& all) const;
    void gather_in(const Cell& cell, const Eigen::Vector3d& x,
                   std::vector<std::uint32_t>& all) const;

    const std::vector<Eigen::Vector3d>& samples_;
    double tolerance_;
    std::vector<std::pair<std::uint64_t, std::uint32_t>>
        hashes_; ///< of the cells, sorted
};

} // namespace cellwarp
