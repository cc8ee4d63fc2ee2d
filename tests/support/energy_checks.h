// SPDX-License-Identifier: GPL-3.0-or-later
// What must hold for every Energy, whatever its state is made of. Only the interface is
// used, so energies to come are checked by the same lines.
#pragma once

#include <random>

#include <Eigen/Core>

#include "solver/minimize/energy.h"

namespace cellwarp::core::support
{

/// H as multiply() has it, column by column; of the last linearise().
Eigen::MatrixXd dense_hessian(const Energy& energy);

// Derivatives by finite differences of the value, from the current state, which is made
// the base and is the current state again afterwards. The errors are of fourth order in
// the length of the steps. Second derivatives are not taken from the gradient: where it
// is in the axes of the moved state, its differences are no second derivatives.

/// All first derivatives.
Eigen::VectorXd gradient_by_values(Energy& energy);
/// x^T H y.
double curvature_by_values(Energy& energy, const Eigen::VectorXd& x,
                           const Eigen::VectorXd& y);
/// All second derivatives; for small energies.
Eigen::MatrixXd hessian_by_values(Energy& energy);

// Checks at the current state, as expectations.

/// Sizes of blocks, order of pairs, sizes of what is given out.
void check_structure(const Energy& energy);
/// gradient() is the derivative of value(); it must not vanish here.
void check_gradient(Energy& energy);
/// multiply() with all curvature gives the second derivatives, along some directions.
void check_curvature(Energy& energy, std::mt19937& rng);
/// The blocks are those of multiply(), which is symmetric and linear.
void check_blocks(Energy& energy, Curvature curvature);
/// J^T J has no negative eigenvalue.
void check_gauss_newton(Energy& energy);
/// Where all residuals are zero there is no curvature but that of J^T J.
void check_zero_residuals(Energy& energy);

/// All but the last.
void check_energy(Energy& energy, std::mt19937& rng);

} // namespace cellwarp::core::support
