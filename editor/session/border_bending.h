// SPDX-License-Identifier: GPL-3.0-or-later
// Sheets bend less around small handles, so that these raise a bulge and no tent.
#pragma once

#include <span>
#include <vector>

#include "editor/session/body.h"
#include "editor/session/region_set.h"

namespace cellwarp
{

/// What every moment of a face grows by (see Face::turning) where it lies around a region
/// that is small beside the shape and has a sheet on most sides, of all faces of \p body
/// [length^2]; empty where none is. \p region_of_cell: as prescribing_regions() says.
std::vector<double> border_bending(const Body& body, const RegionSet& regions,
                                   std::span<const int> region_of_cell);

} // namespace cellwarp
