// SPDX-License-Identifier: GPL-3.0-or-later
// Where an RBF takes its values from the cells.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "solver/cells/constraints.h"

namespace cellwarp
{

/// Points and where they go.
struct RbfCentres
{
    std::vector<Eigen::Vector3d> points, displacements;
};

/// Of each prescribed cell the points where cells that are not prescribed are glued to
/// it: corners, middles of edges and middle of that side of its box. None where the
/// material fills little of the box.
std::vector<std::vector<Eigen::Vector3d>>
border_points(const Cells& cells, std::span<const Constraint> constraints);

/// The anchor of every cell that is not idle, and nothing else.
RbfCentres cell_centres(const Cells& cells, std::span<const Constraint> constraints,
                        std::span<const Pose> poses);

/// Chooses the centres: the anchor of every cell that is not idle; the corners of
/// prescribed ones, whose motion is known, and more points where free cells meet them; of
/// other cells at a free surface a point there; and where the material is one cell thick,
/// points on both sides, because anchors in a plane or on a line say nothing of turns
/// about it. Keeps references to its arguments.
class CentreChoice
{
public:
    CentreChoice(const Cells& cells, std::span<const Constraint> constraints);

    /// The centres of some cells, in their order. A point that prescribed cells of
    /// different motions share is left out.
    RbfCentres centres_of(std::span<const int> some_cells,
                          std::span<const Pose> poses) const;

private:
    bool has_corners(std::size_t cell) const;

    const Cells& cells_;
    std::span<const Constraint> constraints_;
    double finest_ = 0.0; ///< edge of the smallest cell
    /// Further points of each cell.
    std::vector<std::vector<Eigen::Vector3d>> sides_;
    std::vector<std::vector<Eigen::Vector3d>> borders_; ///< see border_points()
};

} // namespace cellwarp
