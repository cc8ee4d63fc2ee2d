// SPDX-License-Identifier: GPL-3.0-or-later
// An implicit surface around balls: where they stand close it is one skin. [Lenoir04]
#pragma once

#include <span>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "library/time/drawn_shapes.h"

namespace cellwarp::core
{

/// \p centres stand half a \p radius apart along curves: around them the surface has that
/// radius, up to 4e-4 of it where they are straight, and rounds what comes near itself. A
/// closed mesh of quads. Throws std::invalid_argument where it would need more than
/// kMostSkinCells.
void add_skin(std::span<const Eigen::Vector3d> centres, double radius,
              const Colour& colour, Geometry& out);

inline constexpr std::size_t kMostSkinCells = 50'000'000;

} // namespace cellwarp::core
