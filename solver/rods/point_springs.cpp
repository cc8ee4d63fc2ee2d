// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/point_springs.h"

#include <utility>

#include "solver/rods/springs.h"

namespace cellwarp::core
{

PointSprings::PointSprings(const Rod& rod, std::vector<PointSpring> springs)
    : rod_(rod), springs_(std::move(springs))
{
    build();
}

void PointSprings::follow(const RodChange&)
{
    build();
}

void PointSprings::build()
{
    distances_.clear();
    for (const PointSpring& spring : springs_)
        distances_.add({shares_of(rod_, rod_.basis().values(spring.s), 0),
                        spring.size * spring.stiffness, spring.length, spring.point});
}

void PointSprings::set_size(std::size_t spring, double size)
{
    springs_[spring].size = size;
    distances_.set_stiffness(spring, size * springs_[spring].stiffness);
}

double PointSprings::value(const RodState& state) const
{
    return distances_.energy(state.x());
}

double PointSprings::stiffness() const
{
    double sum = 0.0;
    for (const PointSpring& spring : springs_)
        sum += spring.stiffness;
    return sum;
}

void PointSprings::add_gradient(const RodState& state, Eigen::VectorXd& out) const
{
    distances_.add_gradient(state.x(), out);
}

void PointSprings::add_hessian(const RodState& state, RodHessian how,
                               BandMatrix& out) const
{
    add_second_derivatives(distances_, state, how, out);
}

std::unique_ptr<PointSprings> point_springs(const Rod& rod,
                                            std::vector<PointSpring> springs)
{
    return std::make_unique<PointSprings>(rod, std::move(springs));
}

} // namespace cellwarp::core
