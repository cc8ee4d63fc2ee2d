// SPDX-License-Identifier: GPL-3.0-or-later
// Which bone's region each node of a lattice belongs to, and how much: by distance, or as
// it was painted.
#pragma once

#include <span>
#include <vector>

#include "editor/flesh/flesh_model.h"
#include "octree/cells.h"
#include "solver/flesh/blended_regions.h"

namespace cellwarp
{

/// By straight distances to the bones; where the way through the glue of \p cells, if
/// any, is much longer, by that. Painted weights replace them. \p cell_of_sample: of the
/// lattice, where weights may be painted. Throws Fault::Malformed for what the scene says
/// of them, and what read_weights() throws.
std::vector<FleshRegionShares> region_weights(const FleshModel& model,
                                              const Lattice& lattice, const Cells* cells,
                                              std::span<const int> cell_of_sample);

} // namespace cellwarp
