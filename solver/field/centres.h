// SPDX-License-Identifier: GPL-3.0-or-later
// Where an RBF takes its values from the cells.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "solver/cells/constraints.h"
#include "solver/field/region_points.h"

namespace cellwarp::core
{

/// Points and where they go.
struct RbfCentres
{
    std::vector<Eigen::Vector3d> points, displacements;
};

/// The anchor of every cell that is not idle, and nothing else.
RbfCentres cell_centres(const Cells& cells, std::span<const Constraint> constraints,
                        std::span<const Pose> poses);

/// Chooses the centres: the anchor of every cell that is not idle; the points of regions
/// (RegionPoints); of other cells at a free surface a point there; and where the material
/// is one cell thick, points on both sides, because anchors in a plane or on a line say
/// nothing of turns about it. Keeps references to its arguments.
class CentreChoice
{
public:
    CentreChoice(const Cells& cells, std::span<const Constraint> constraints);

    /// The centres of some cells, in their order. A point that prescribed cells of
    /// different motions share is left out.
    RbfCentres centres_of(std::span<const int> some_cells,
                          std::span<const Pose> poses) const;
    RbfCentres centres_of_all(std::span<const Pose> poses) const;

private:
    const Cells& cells_;
    std::span<const Constraint> constraints_;
    /// Further points of each cell.
    std::vector<std::vector<Eigen::Vector3d>> sides_;
    RegionPoints of_regions_;
};

} // namespace cellwarp::core
