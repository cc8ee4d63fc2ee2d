// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

namespace cellwarp::core
{

/// From 0 up to \p low to 1 from \p high on, without a corner.
inline double smooth_step(double low, double high, double x)
{
    const double u = std::clamp((x - low) / (high - low), 0.0, 1.0);
    return u * u * (3.0 - 2.0 * u);
}

} // namespace cellwarp::core
