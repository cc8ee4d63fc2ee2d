// SPDX-License-Identifier: GPL-3.0-or-later
// Conjugate gradients for the step of a Newton method. [Steihaug83]
#pragma once

#include <stop_token>

#include <Eigen/Core>

#include "octree/base/clock.h"
#include "solver/linear/linear_operator.h"

namespace cellwarp
{

struct LinearReport
{
    int steps = 0;
    double residual = 0.0; ///< relative to the right-hand side
    bool has_negative_curvature = false;
};

/// When a solve ends.
struct LinearLimits
{
    double tolerance = 1e-6; ///< of the residual, relative to the right-hand side
    int max_steps = 100;
    Clock::time_point deadline = Clock::time_point::max();
    std::stop_token stop = {};
};

/// Keeps its vectors between calls: nothing is allocated for problems of one size.
class ConjugateGradients
{
public:
    explicit ConjugateGradients(Eigen::Index size = 0)
        : r_(size), z_(size), direction_(size), image_(size), last_r_(size)
    {
    }

    /// Solves H x = b, from 0. Ends early, with what it has,
    /// which descends, at a direction of negative curvature (with the first direction
    /// itself, if it is that one), and at its limits, but not without a step.
    LinearReport solve(const LinearOperator& H, Preconditioner& preconditioner,
                       const Eigen::VectorXd& b, const LinearLimits& limits,
                       Eigen::VectorXd& x);

private:
    Eigen::VectorXd r_, z_, direction_, image_, last_r_;
};

} // namespace cellwarp
