// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>

namespace cellwarp::core
{

/// What a sum of numbers of size 1 may be wrong by.
inline constexpr double kRounding = std::numeric_limits<double>::epsilon();

} // namespace cellwarp::core
