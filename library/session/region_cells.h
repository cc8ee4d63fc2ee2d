// SPDX-License-Identifier: GPL-3.0-or-later
// What the regions are to the cells of a body: which they prescribe, how stiff they are,
// and where the glue at their borders begins.
#pragma once

#include <span>
#include <vector>

#include "library/session/body.h"
#include "library/session/region_set.h"
#include "solver/cells/glue.h"

namespace cellwarp::core
{

/// Which region prescribes each cell, by index; -1 if none. The share must be at
/// least half; of two such regions the larger share, then the first. A region that
/// reaches no such cell, or none in a component that holds samples of it, takes all cells
/// there within 1e-6 of its largest share. A rod has what others leave of the cells that
/// its tube meets, of two rods the first. Throws Fault::Unsolvable if a region is left
/// without a cell, at all or in such a component, because others hold them.
std::vector<int> prescribing_regions(const RegionSet& regions,
                                     std::span<const RegionShares> shares,
                                     const Cells& cells);

/// The cells of all connected parts of regions that prescribe none of them: in smaller
/// ones they may have some.
std::vector<int> crowded_cells(const RegionSet& regions,
                               std::span<const RegionShares> shares, const Cells& cells);

/// The stiffness factor of each cell; empty if no region is stiff.
std::vector<double> cell_factors(const RegionSet& regions,
                                 std::span<const RegionShares> shares,
                                 std::size_t num_cells);

/// The faces of \p body between cells that a region moves as a whole, by one motion, and
/// cells that it does not. There glue begins where the region ends, to a voxel, and ends
/// in the middle of the free cell.
std::vector<BorderGlue> border_glue(const Body& body, const RegionSet& regions,
                                    std::span<const int> region_of_cell);

} // namespace cellwarp::core
