// SPDX-License-Identifier: GPL-3.0-or-later
// Sheets resist bending more around small handles, so that these raise a bulge and no
// tent.
#pragma once

#include <span>
#include <vector>

#include "library/session/body.h"
#include "library/session/region_set.h"

namespace cellwarp::core
{

/// The `bending` of build_glue() where faces lie around a region that is a small disc of
/// a sheet, with the sheet on most sides; of all faces of \p body [length^2]; empty where
/// none is. A region of several discs is none.
/// \p shares: of the regions in the body.
std::vector<double> border_bending(const Body& body, const RegionSet& regions,
                                   std::span<const RegionShares> shares);

} // namespace cellwarp::core
