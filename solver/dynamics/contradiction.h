// SPDX-License-Identifier: GPL-3.0-or-later
// What of constraints cannot be met.
#pragma once

#include <span>

#include <Eigen/Core>

#include "solver/dynamics/saddle.h"

namespace cellwarp::core
{

/// The part r of the violations of rows L that no step removes, to first order:
/// L^T r = 0. What is left of them is met by least squares.
Eigen::VectorXd contradiction(std::span<const SparseRow> rows,
                              const Eigen::VectorXd& violation);

} // namespace cellwarp::core
