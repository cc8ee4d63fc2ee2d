// SPDX-License-Identifier: GPL-3.0-or-later
// A lattice that was drawn by hand, from its file: cells, the points that bones hold, and
// where samples lie in it.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/flesh/flesh_model.h"
#include "editor/flesh/region_weights.h"
#include "solver/flesh/bone_tube.h"
#include "solver/flesh/bound_nodes.h"
#include "solver/flesh/lattice.h"

namespace cellwarp
{

struct DrawnFlesh
{
    Lattice lattice;
    std::vector<HeldPoint> points; ///< on bones
    std::vector<TubeBone> bones;   ///< each with a radius
    ControlShares vertices;
};

/// With cells halved and materials as the scene has them. Throws Fault::Budget for too
/// many cells, Fault::Malformed for a material of no cell, cells that are turned inside
/// out or stand twice, and edges that lie on no bone; and what read_medit() throws.
DrawnFlesh read_drawn_flesh(const FleshModel& model);

/// The cell of a drawn lattice that holds a point; negative: none.
int drawn_cell_of(const Lattice& lattice, const Eigen::Vector3d& metres);

/// The cell that each sample lies in, or nearest to, and where in it.
void locate_samples(const FleshModel& model, const Lattice& lattice,
                    std::vector<int>& cell_of_sample, std::vector<Eigen::Vector3d>& local,
                    std::vector<std::string>& warnings);

} // namespace cellwarp
