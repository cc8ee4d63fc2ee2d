// SPDX-License-Identifier: GPL-3.0-or-later
// The inner loop of RbfField: sums over all centres at one point, for each instruction
// set. All make the same sums in the same order, so their results are the same to the
// bit.
#pragma once

#include <cstddef>

#include "solver/field/instruction_set.h"

namespace cellwarp
{

/// Centres are lanes: their count is padded to a multiple of this, with weights of 0.
constexpr std::size_t kCentreLanes = 8;

/// Centres and weights as six rows: x, y, z of the centres, then of the weights.
struct RbfRun
{
    const double* rows = nullptr;
    std::size_t num_padded = 0; ///< of each row
    double place[3] = {0, 0, 0};
    double displacement[3] = {0, 0, 0}; ///< out: sum w_j |r_j|^3, r_j = place - c_j
    double slopes[9] = {};              ///< out: sum w_j 3 |r_j| r_j, axis by axis of r
};

struct RbfKernels
{
    void (*displacement)(RbfRun&);
    void (*value)(RbfRun&); ///< the slopes as well; the displacement has the same bits
};

/// \pre \p set is one of instruction_sets()
RbfKernels rbf_kernels(InstructionSet set);

} // namespace cellwarp
