// SPDX-License-Identifier: GPL-3.0-or-later
// With the step h, displacements u0 and velocities v0 before it, and w = u - u0 - h v0:
//   Phi(u) = w^T M w / 2 h^2 + (u - u0)^T C (u - u0) / 2 h + V(u) - f^T u,
// whose minimum over the free nodes is the step of implicit Euler: its gradient is what
// is left of forces and inertia, M (v - v0) / h + C v - (forces at u). V is the elastic
// energy and that of the tubes. With cells' frames it is quadratic while the frames
// stand: they are those of the predicted u, as in flesh.cpp, so that a step is the same
// there and here. C = alpha M + beta K.
#include "solver/flesh/flesh_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/flesh/flesh_parts.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

} // namespace

FleshStep::FleshStep(Flesh& flesh)
    : parts_(*flesh.parts_),
      matrix_(parts_.lattice, parts_.materials, by_free_of_all(parts_.nodes), num_free())
{
    if (parts_.regions)
        throw std::invalid_argument("blended regions are the minimum of nothing");
    if (num_free() > 0)
        factor_ = std::make_unique<SparseCholesky>(matrix_.blocks());
    diagonal_ = VectorXd::Zero(Eigen::Index(3 * num_free()));
}

std::size_t FleshStep::num_free() const
{
    return parts_.nodes.free.size();
}

void FleshStep::begin(const FleshState& from, double dt, std::span<const Motion> motions,
                      VectorXd& u)
{
    from_ = from;
    dt_ = dt;
    is_factorized_ = false;
    motions_.assign(motions.begin(), motions.end());
    parts_.find_carried(motions);
    VectorXd gamma(Eigen::Index(3 * parts_.points.size()));
    for (std::size_t k = 0; k < parts_.points.size(); ++k)
        gamma.segment<3>(Eigen::Index(3 * k)) =
            Flesh::Parts::displacement_of(parts_.points[k], motions);
    VectorXd free(Eigen::Index(3 * num_free()));
    for (std::size_t k = 0; k < num_free(); ++k)
    {
        const Eigen::Index node = 3 * parts_.nodes.free[k];
        free.segment<3>(Eigen::Index(3 * k)) =
            from.u.segment<3>(node) + dt * from.v.segment<3>(node);
    }
    parts_.expand(free, &gamma, u);
    if (parts_.settings.law == FleshLaw::Cells)
        parts_.forces.follow(from.u + dt * from.v);
}

void FleshStep::move(const VectorXd& from, const VectorXd& step, double length,
                     VectorXd& u) const
{
    parts_.expand(step, nullptr, all_);
    u = from + length * all_;
}

double FleshStep::value(const VectorXd& u) const
{
    const FleshSettings& how = parts_.settings;
    way_ = u - from_.u - dt_ * from_.v;
    parts_.forces.multiply(way_, {1.0, 0.0, 0.0}, image_);
    double value = way_.dot(image_) / (2.0 * dt_ * dt_);
    if (how.alpha > 0.0 || how.beta > 0.0)
    {
        way_ = u - from_.u;
        parts_.forces.multiply(way_, {how.alpha, how.beta, 0.0}, image_);
        value += way_.dot(image_) / (2.0 * dt_);
    }
    return value + parts_.forces.elastic_energy(u) +
           parts_.forces.tube_energy(u, motions_) - parts_.outer_forces().dot(u);
}

double FleshStep::gradient(const VectorXd& u, VectorXd& out) const
{
    const FleshSettings& how = parts_.settings;
    way_ = u - from_.u - dt_ * from_.v;
    parts_.forces.multiply(way_, {1.0 / (dt_ * dt_), 0.0, 0.0}, all_);
    double largest = all_.cwiseAbs().maxCoeff();
    if (how.alpha > 0.0 || how.beta > 0.0)
    {
        way_ = u - from_.u;
        parts_.forces.multiply(way_, {how.alpha / dt_, how.beta / dt_, 0.0}, image_);
        all_ += image_;
    }
    parts_.forces.forces(u, motions_, image_);
    largest = std::max(
        {largest, image_.cwiseAbs().maxCoeff(), parts_.weight.cwiseAbs().maxCoeff()});
    all_ -= image_ + parts_.outer_forces();
    parts_.reduce(all_, out);
    return largest;
}

bool FleshStep::factorize(const VectorXd& u)
{
    if (num_free() == 0)
        return true;
    const FleshSettings& how = parts_.settings;
    if (parts_.is_of_large_strain())
        parts_.forces.follow(u);
    else if (std::exchange(is_factorized_, true))
        return true; // of a quadratic function, in the same step
    matrix_.assemble(parts_.forces,
                     {1.0 / (dt_ * dt_) + how.alpha / dt_, 1.0 + how.beta / dt_, 1.0});
    for (std::size_t k = 0; k < num_free(); ++k)
        diagonal_.segment<3>(Eigen::Index(3 * k)) =
            matrix_.blocks().diagonal(static_cast<int>(k)).diagonal();
    const bool has_factor = factor_->factorize(matrix_.blocks());
    is_factorized_ = is_factorized_ && has_factor;
    return has_factor;
}

void FleshStep::solve(VectorXd& r) const
{
    if (num_free() == 0)
        return;
    factor_->solve(r, solved_);
    r = solved_;
}

double FleshStep::turn(const VectorXd& step) const
{
    if (!parts_.is_of_large_strain())
        return 0.0;
    parts_.expand(step, nullptr, all_);
    std::vector<Matrix3d> F;
    parts_.forces.mean_deformations(all_, F);
    double most = 0.0;
    for (const Matrix3d& of : F)
        most = std::max(most, (of - Matrix3d::Identity()).norm());
    return most;
}

FleshState FleshStep::end(const VectorXd& u) const
{
    return {u, (u - from_.u) / dt_};
}

} // namespace cellwarp::core
