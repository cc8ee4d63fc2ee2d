// SPDX-License-Identifier: GPL-3.0-or-later
// Springs from places of a rod to places of the world.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "solver/dynamics/distance_springs.h"
#include "solver/rods/rod_term.h"

namespace cellwarp::core
{

struct PointSpring
{
    double s = 0.0; ///< parameter of the curve
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    double stiffness = 0.0; ///< [N/m]
    double length = 0.0;    ///< at rest [m]
    double size = 1.0;      ///< of the stiffness
};

/// 1/2 size stiffness (|P - point| - length)^2 each.
class PointSprings final : public RodTerm
{
public:
    /// The rod must outlive it.
    PointSprings(const Rod& rod, std::vector<PointSpring> springs);

    void set_size(std::size_t spring, double size);

    void follow(const RodChange& change) override;
    double value(const RodState& state) const override;
    double stiffness() const override;
    void add_gradient(const RodState& state, Eigen::VectorXd& out) const override;
    void add_hessian(const RodState& state, RodHessian how,
                     BandMatrix& out) const override;

private:
    void build();

    const Rod& rod_;
    std::vector<PointSpring> springs_;
    DistanceSprings distances_;
};

std::unique_ptr<PointSprings> point_springs(const Rod& rod,
                                            std::vector<PointSpring> springs);

} // namespace cellwarp::core
