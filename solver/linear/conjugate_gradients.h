// SPDX-License-Identifier: GPL-3.0-or-later
// Conjugate gradients for the step of a Newton method. [Steihaug83]
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "octree/base/clock.h"
#include "solver/linear/linear_operator.h"

namespace cellwarp::core
{

struct LinearReport
{
    int steps = 0;
    /// Relative to the right-hand side; of x before it went on to where a trust region
    /// ends.
    double residual = 0.0;
    bool has_negative_curvature = false;
    double size = 0.0;   ///< of x, sqrt(x^T M x) with the preconditioner's M
    double change = 0.0; ///< of 1/2 x^T H x - b^T x, from 0 to x
};

/// When a solve ends; also where is_stop_requested().
struct LinearLimits
{
    double tolerance = 1e-6; ///< of the residual, relative to the right-hand side
    int max_steps = 100;
    Clock::time_point deadline = Clock::time_point::max();
    /// Of a trust region: x gets no larger (LinearReport::size). \pre positive
    double radius = INFINITY;
};

/// Keeps its vectors between calls: nothing is allocated for problems of one size.
class ConjugateGradients
{
public:
    explicit ConjugateGradients(Eigen::Index size = 0)
        : r_(size), z_(size), direction_(size), image_(size), last_r_(size)
    {
    }

    /// Solves H x = b, from 0. Ends early, with what it has, which descends, at its
    /// limits, but not without a step. It also ends at a direction of negative curvature:
    /// goes along that to where the trust region ends; where there is none with what it
    /// has (with the first direction itself, if it is that one).
    LinearReport solve(const LinearOperator& H, Preconditioner& preconditioner,
                       const Eigen::VectorXd& b, const LinearLimits& limits,
                       Eigen::VectorXd& x);

private:
    Eigen::VectorXd r_, z_, direction_, image_, last_r_;
};

} // namespace cellwarp::core
