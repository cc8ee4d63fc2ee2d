// SPDX-License-Identifier: GPL-3.0-or-later
// Samples at one place: what is done to one of them is meant for all.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// Samples of a model that are no farther apart are at one place [diagonal].
inline constexpr double kCoincident = 1e-9;

/// Immutable. Keeps a reference to the samples.
class CoincidentSamples
{
public:
    /// Samples coincide that are no farther apart than \p tolerance: usually
    /// kCoincident of a model's diagonal.
    CoincidentSamples(const std::vector<Eigen::Vector3d>& samples, double tolerance);

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

} // namespace cellwarp::core
