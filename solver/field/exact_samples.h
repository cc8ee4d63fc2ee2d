// SPDX-License-Identifier: GPL-3.0-or-later
// Finds where the corrections of a body's regions act (region_fade.h).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "solver/cells/constraints.h"
#include "solver/field/region_fade.h"

namespace cellwarp::core
{

/// The samples of a region that end exactly where it moves them.
struct ExactSamples
{
    std::span<const std::uint32_t> samples; ///< none: the region needs no correction
    bool is_rigid = true;                   ///< it has one motion; else it is a rod
};

/// Around the samples of the \p regions, and around the points of their cells at their
/// borders, where the field knows the motion too. Without these the motion just outside
/// would depend on how near the last sample of the region happens to be. One a region;
/// none for one without samples, or whose samples other regions have all.
/// \p region_of_cell: -1: none; \p places and \p cell_of_sample of all samples.
std::vector<std::optional<RegionFade>>
fades_of(std::span<const ExactSamples> regions, const Cells& cells,
         std::span<const Constraint> constraints, std::span<const int> region_of_cell,
         std::span<const Eigen::Vector3d> places, std::span<const int> cell_of_sample);

} // namespace cellwarp::core
