// SPDX-License-Identifier: GPL-3.0-or-later
// The preconditioner may round in single precision: beta is taken with the change of the
// residual, which stays right for a preconditioner that is not quite linear.
#include "solver/linear/conjugate_gradients.h"

#include <cmath>

namespace cellwarp
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
    const auto is_out_of_time = [&]
    {
        return report.steps > 0 &&
               (limits.stop.stop_requested() || Clock::now() > limits.deadline);
    };
    while (report.steps < limits.max_steps && !is_out_of_time())
    {
        H.multiply(direction_, image_);
        const double curvature = direction_.dot(image_);
        ++report.steps;
        if (!(curvature > 0.0))
        {
            report.has_negative_curvature = true;
            if (report.steps == 1)
                x = direction_;
            break;
        }
        const double length = r_z / curvature;
        x.noalias() += length * direction_;
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
    }
    report.residual = r_.norm() / size;
    return report;
}

} // namespace cellwarp
