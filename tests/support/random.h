// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers and vectors by a seeded generator.
#pragma once

#include <random>

#include <Eigen/Core>

namespace cellwarp::core::support
{

double random_number(std::mt19937& rng, double low, double high);
Eigen::Vector3d random_vector(std::mt19937& rng, double size);

} // namespace cellwarp::core::support
