// SPDX-License-Identifier: GPL-3.0-or-later
// The curve of a line that is stated.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "io/scene/spline_line.h"
#include "solver/rods/spline.h"

namespace cellwarp::core
{

/// The curve of \p line with \p points instead of its own, which may be in other units.
/// \p parameters, if given, gets those of the points that it goes through. Throws
/// std::invalid_argument for points that make none.
Spline curve_of(const SplineLine& line, std::vector<Eigen::Vector3d> points,
                std::vector<double>* parameters = nullptr);

} // namespace cellwarp::core
