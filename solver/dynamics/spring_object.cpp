// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/spring_object.h"

#include <utility>

#include "solver/linear/rounding.h"

namespace cellwarp::core
{

void SpringObject::stand_at(Eigen::VectorXd points)
{
    x = start_ = trial_ = std::move(points);
    velocity = velocity_before_ = Eigen::VectorXd::Zero(x.size());
}

double SpringObject::noise_of_forces() const
{
    return 8.0 * kRounding * (springs_.stiffest() + pull_ * weights_.maxCoeff()) *
           extent();
}

double SpringObject::weight(const Eigen::VectorXd& at) const
{
    double sum = 0.0;
    for (Eigen::Index k = 0; k < weights_.size(); ++k)
        sum -= weights_[k] * gravity.dot(at.segment<3>(3 * k));
    return sum;
}

ArticulableObject::Energy SpringObject::energy() const
{
    const double moving = kinetic(), stretched = elastic();
    return {moving + stretched + weight(x), moving + stretched};
}

void SpringObject::start(double step)
{
    step_ = step;
    pull_ = 1.0 / (step * step);
    start_ = x;
    velocity_before_ = velocity;
    // Implicit Euler damps as a material with damping = step does.
    springs_.damp(x, std::max(damping - step, 0.0) / step);
}

void SpringObject::finish()
{
    velocity = (x - start_) / step_;
    springs_.damp(x, 0.0);
}

void SpringObject::undo()
{
    springs_.damp(start_, 0.0);
    x = start_;
    velocity = velocity_before_;
}

} // namespace cellwarp::core
