// SPDX-License-Identifier: GPL-3.0-or-later
// Conjugate gradients for the step of a Newton method. [Steihaug83]
#pragma once

#include <stop_token>

#include <Eigen/Core>

#include "solver/energy.h"

namespace cellwarp
{

struct LinearReport
{
    int steps = 0;
    double residual = 0.0; ///< relative to the right-hand side
    bool has_negative_curvature = false;
};

/// Keeps its vectors between calls: nothing is allocated for problems of one size.
class ConjugateGradients
{
public:
    /// Solves H x = b for the linearised \p energy, from 0, until the residual is
    /// \p tolerance times that of 0. Ends early at a direction of negative curvature with
    /// what it has, which descends (the first direction itself, if it is that one), after
    /// \p max_steps, and on request.
    LinearReport solve(const Energy& energy, Preconditioner& preconditioner,
                       const Eigen::VectorXd& b, double tolerance, int max_steps,
                       const std::stop_token& stop, Eigen::VectorXd& x);

private:
    Eigen::VectorXd r_, z_, direction_, image_, last_r_;
};

} // namespace cellwarp
