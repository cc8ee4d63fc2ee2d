// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/random.h"

namespace cellwarp::core::support
{

double random_number(std::mt19937& rng, double low, double high)
{
    return low + (high - low) * static_cast<double>(rng()) / 4294967296.0;
}

Eigen::Vector3d random_vector(std::mt19937& rng, double size)
{
    Eigen::Vector3d v;
    for (int k = 0; k < 3; ++k)
        v[k] = random_number(rng, -size, size);
    return v;
}

} // namespace cellwarp::core::support
