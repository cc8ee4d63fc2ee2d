// SPDX-License-Identifier: GPL-3.0-or-later
// [Steihaug83]: from one direction to the next x gets larger in the norm of M, the
// preconditioner's matrix, so that the first one to leave the trust region leaves it for
// good. M is not known, but p^T M p and x^T M p follow from the steps: with the new
// residual r and z = M^-1 r,
//   p' = z + beta p,  p'^T M p' = r^T z + beta^2 p^T M p,  x'^T M p' = beta x'^T M p,
// because r is orthogonal to all directions before it, and x' is made of these.
// The preconditioner may round in single precision: beta is taken with the change of the
// residual, which stays right for a preconditioner that is not quite linear.
#include "solver/linear/conjugate_gradients.h"

#include <algorithm>
#include <cmath>

#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

LinearReport ConjugateGradients::solve(const LinearOperator& H,
                                       Preconditioner& preconditioner,
                                       const Eigen::VectorXd& b,
                                       const LinearLimits& limits, Eigen::VectorXd& x)
{
    LinearReport report;
    const double size = b.norm();
    x.setZero(b.size());
    if (size == 0.0)
        return report;
    r_ = b;
    preconditioner.apply(r_, z_);
    direction_ = z_;
    double r_z = r_.dot(z_);
    const double radius_squared = limits.radius * limits.radius;
    // Where rounding has made the preconditioner indefinite it measures nothing.
    const bool is_bounded = std::isfinite(radius_squared) && r_z > 0.0;
    // x^T M x, x^T M p and p^T M p, of the direction p.
    double x_x = 0.0, x_p = 0.0, p_p = r_z;
    const auto go = [&](double length, double curvature)
    {
        x.noalias() += length * direction_;
        x_x += length * (2.0 * x_p + length * p_p);
        x_p += length * p_p;
        report.change += length * (0.5 * length * curvature - r_z);
    };
    // The way along the direction to where the trust region ends.
    const auto way_left = [&]
    {
        const double left = radius_squared - x_x;
        const double root = std::sqrt(x_p * x_p + p_p * left);
        return x_p > 0.0 ? left / (x_p + root) : (root - x_p) / p_p;
    };
    const auto is_out_of_time = [&] {
        return report.steps > 0 &&
               (is_stop_requested() || Clock::now() > limits.deadline);
    };
    while (report.steps < limits.max_steps && !is_out_of_time())
    {
        H.multiply(direction_, image_);
        const double curvature = direction_.dot(image_);
        ++report.steps;
        if (!(curvature > 0.0))
        {
            report.has_negative_curvature = true;
            if (is_bounded)
                go(way_left(), curvature);
            else if (report.steps == 1)
                go(1.0, curvature);
            break;
        }
        const double length = r_z / curvature;
        if (is_bounded && x_x + length * (2.0 * x_p + length * p_p) >= radius_squared)
        {
            go(way_left(), curvature);
            break;
        }
        go(length, curvature);
        last_r_ = r_;
        r_.noalias() -= length * image_;
        if (!(r_.norm() > limits.tolerance * size))
            break;
        preconditioner.apply(r_, z_);
        const double beta = (r_.dot(z_) - last_r_.dot(z_)) / r_z;
        r_z = r_.dot(z_);
        // Rounding has made the preconditioner indefinite here: no better direction is
        // left.
        if (!(r_z > 0.0))
            break;
        direction_ = z_ + beta * direction_;
        x_p *= beta;
        p_p = r_z + beta * beta * p_p;
    }
    report.size = std::sqrt(std::max(0.0, x_x));
    report.residual = r_.norm() / size;
    return report;
}

} // namespace cellwarp::core
