// SPDX-License-Identifier: GPL-3.0-or-later
// Unknowns as a multigrid of rigid bodies sees them: what each does to a small body.
#pragma once

#include <Eigen/Core>

#include "solver/cells/grouping.h"

namespace cellwarp::core
{

/// Some unknowns of a block, one after the other, that turn and shift one body: a cell, a
/// control point of a rod (which only shifts), an angle of a rod (which only turns about
/// its tangent). Moved as part of a larger body, its unknowns are those of the part of
/// that motion that they can make.
struct UnknownBody
{
    int block = 0;
    int first = 0;  ///< of its unknowns, in the block
    int turns = 0;  ///< so many unknowns turn it about its centre,
    int shifts = 0; ///< and so many after them shift it
    /// In common axes, a column an unknown, then zeros: unit vectors across each other,
    /// or zero for an unknown that does nothing as long as it is held.
    Eigen::Matrix3d turn = Eigen::Matrix3d::Zero(), shift = Eigen::Matrix3d::Zero();
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    GridPlace grid;
    /// Solved for exactly, together with all others of which this is true, wherever
    /// errors are smoothed.
    bool is_on_rod = false;
};

} // namespace cellwarp::core
