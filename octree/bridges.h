// SPDX-License-Identifier: GPL-3.0-or-later
// Bridges: which component of the material goes with which other one where nothing else
// holds it, and between which of their cells.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "octree/notches.h"
#include "octree/pieces.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// Between two cells of different components, as a face is between cells that touch.
struct Bridge
{
    int a = 0, b = 0; ///< a cell of what is bridged to, a cell of what is bridged
    double area = 0.0;
    double length = 0.0; ///< over which it stretches
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    /// Second moment about the centre, divided by the area [length^2].
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
};

/// A component that is bridged, and the one that it goes with.
struct BridgedComponent
{
    int component = 0, to = 0;
    int first = 0, end = 0; ///< of its bridges
};

/// Rest state: immutable once built.
struct Bridges
{
    /// In an order in which each one goes with one that is held or stands before it.
    std::vector<BridgedComponent> components;
    std::vector<Bridge> all;
};

/// Bridges the components that are not held, one after another, each time the one that is
/// nearest to those that are held or bridged already, to the nearest of these; of several
/// that are equally near the first. They form a tree: what is held takes no stress from
/// it. \p component: of each cell (connected_components()); \p is_held: of each
/// component. Nothing held: no bridges. \p notches: those of \p pieces.
Bridges find_bridges(const VoxelGrid& grid, const Pieces& pieces, const Notches& notches,
                     std::span<const int> component, const std::vector<bool>& is_held);

} // namespace cellwarp::core
