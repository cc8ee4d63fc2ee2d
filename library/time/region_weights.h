// SPDX-License-Identifier: GPL-3.0-or-later
// Which bone's region each node of a lattice belongs to, and how much: by distance, or as
// it was painted.
#pragma once

#include <span>
#include <vector>

#include "library/time/flesh_model.h"
#include "octree/cells.h"
#include "solver/flesh/blended_regions.h"

namespace cellwarp::core
{

/// The vertices of a drawn lattice's file, and each node as a mean of them.
struct ControlShares
{
    std::size_t size = 0;
    std::vector<NodeShares> of_node;
    double edge = 0.0; ///< the longest of the cells before detail [m]
};

/// By straight distances to the bones; where the way through the glue of \p cells, if
/// any, is much longer, by that. Painted weights replace them: of \p vertices of a drawn
/// lattice, if any, where there are as many, else of samples. \p cell_of_sample: of the
/// lattice. Throws Fault::Malformed for what the scene says
/// of them, and what read_weights() throws.
std::vector<FleshRegionShares> region_weights(const FleshModel& model,
                                              const Lattice& lattice, const Cells* cells,
                                              std::span<const int> cell_of_sample,
                                              const ControlShares* vertices = nullptr);

} // namespace cellwarp::core
