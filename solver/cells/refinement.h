// SPDX-License-Identifier: GPL-3.0-or-later
// Where smaller cells are wanted, and how they start: errors of cells as lengths, the
// leaves to split and to merge, poses handed on from one set of cells to another.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "octree/octree.h"
#include "octree/pieces.h"
#include "solver/cells/constraints.h"
#include "solver/cells/glue.h"

namespace cellwarp::core
{

/// The body's map around a cell, as the cell and its neighbours tell it:
/// x -> place + gradient (x - anchor), its rotation exp(turning (x - anchor)) R.
struct LocalMap
{
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    Eigen::Matrix3d gradient = Eigen::Matrix3d::Identity();
    Eigen::Matrix3d turning = Eigen::Matrix3d::Zero();
};

/// Of every cell. Cells that are prescribed or idle move as rigid bodies.
std::vector<LocalMap> local_maps(const Cells& cells, const Glue& glue,
                                 std::span<const Constraint> constraints,
                                 std::span<const Pose> poses);

/// The least share of its length to which the material is pressed together anywhere, by
/// the maps around the free cells; negative where it is turned inside out.
double least_stretch(const Cells& cells, const Glue& glue,
                     std::span<const Constraint> constraints,
                     std::span<const Pose> poses);

/// How far the body is, at the borders of each cell, from the affine map around it: what
/// rigid motions and a blend of them cannot follow [length].
std::vector<double> cell_errors(const Cells& cells, const Glue& glue,
                                std::span<const Constraint> constraints,
                                std::span<const Pose> poses);

/// The largest gap of each cell to a neighbour: the root of the mean squared distance of
/// their two motions over what both are measured on [length]. [Botsch07]
std::vector<double> pair_gaps(const Cells& cells, const Glue& glue,
                              std::span<const Pose> poses);

/// The poses of the cells of another octree of the same material: what stays keeps its
/// pose, children follow the local map of their parent, what merges the mean of its
/// parts.
std::vector<Pose> handed_on(const VoxelGrid& grid, const Pieces& old_pieces,
                            const Cells& old_cells, std::span<const Pose> old_poses,
                            std::span<const LocalMap> old_maps, const Octree& octree,
                            const Pieces& pieces, const Cells& cells);

} // namespace cellwarp::core
