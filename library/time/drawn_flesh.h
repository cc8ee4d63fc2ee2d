// SPDX-License-Identifier: GPL-3.0-or-later
// A lattice that was drawn by hand, from its file: its cells, halved or not, the points
// that bones hold, and where samples lie in it.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "library/time/flesh_model.h"
#include "library/time/region_weights.h"
#include "solver/flesh/bone_tube.h"
#include "solver/flesh/bound_nodes.h"
#include "solver/flesh/drawn_forest.h"
#include "solver/flesh/lattice.h"

namespace cellwarp::core
{

/// All that lattices of the same drawn cells have in common.
struct DrawnFlesh
{
    DrawnForest forest;
    /// The cells that are there for good: with detail the drawn ones, else the halved
    /// ones; their materials, and the longest edge of all [m].
    Octree first;
    std::vector<int> materials = {};
    double edge = 0.0;
    std::size_t num_vertices = 0; ///< in the file
    /// Edges on bones, by their vertices, and these themselves: what moves them.
    std::map<std::vector<int>, int> motion_of_edge = {};
    std::vector<BoneLine> lines = {};             ///< of bones that no edges follow
    std::vector<TubeBone> bones = {};             ///< each with a radius
    std::vector<DrawnForest::Place> samples = {}; ///< in the hexahedra
    std::vector<std::uint32_t> fine = {};         ///< samples in detail_regions
};

/// Materials as the scene has them. Throws Fault::Budget for too many cells,
/// Fault::Malformed for a material of no cell, cells that are turned inside out or stand
/// twice, and edges that lie on no bone; and what read_medit() throws.
DrawnFlesh read_drawn_flesh(const FleshModel& model, std::vector<std::string>& warnings);

/// The lattice of an octree, with the materials of the drawn cells.
struct DrawnLattice
{
    Lattice lattice;
    std::vector<HeldPoint> points; ///< on bones
    ControlShares vertices;
};
DrawnLattice lattice_of(const DrawnFlesh& drawn, const Octree& octree);

/// The cell of a drawn lattice that holds a point; negative: none.
int drawn_cell_of(const Lattice& lattice, const Eigen::Vector3d& metres);

} // namespace cellwarp::core
