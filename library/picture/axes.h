// SPDX-License-Identifier: GPL-3.0-or-later
// Three edges of a box with numbers along them, drawn over a picture.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "library/picture/image.h"
#include "library/picture/lettering.h"
#include "library/picture/projection.h"

namespace cellwarp::core
{

/// Round numbers of \p low to \p high, evenly, three to eight of them; none where the two
/// are the same.
std::vector<double> ticks_between(double low, double high);

/// Draws of each axis the edge of \p box that is outermost: of the upright one the
/// leftmost, of the others the lowest. An axis that the viewer looks along is left out.
/// \p first_column: where the figure begins in \p image.
void draw_axes(const Eigen::AlignedBox3d& box, int up_axis, const Projection& projection,
               const Lettering& lettering, int first_column, Image& image);

} // namespace cellwarp::core
