// SPDX-License-Identifier: GPL-3.0-or-later
// Samples that lie at one place, to the bit.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// For every sample the first of those at its very place.
std::vector<std::uint32_t> joined_samples(const std::vector<Eigen::Vector3d>& samples);

} // namespace cellwarp::core
