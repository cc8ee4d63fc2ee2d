// SPDX-License-Identifier: GPL-3.0-or-later
// Gauss quadrature on [0, 1]: int f = sum_k weight_k f(place_k), exact for polynomials up
// to degree 2 count - 1.
#pragma once

#include <span>

namespace cellwarp::core
{

inline constexpr int kMaxGaussPlaces = 9;

/// Ascending. \pre 1 <= count <= kMaxGaussPlaces
std::span<const double> gauss_places(int count);
/// Their sum is 1.
std::span<const double> gauss_weights(int count);

} // namespace cellwarp::core
