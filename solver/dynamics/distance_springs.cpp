// SPDX-License-Identifier: GPL-3.0-or-later
// With e = sum c_k x_k - from, D = |e| and n = e / D:
//   U = 1/2 k (D - L)^2,   dU = k (D - L) n . de,
//   d2U = de . {k n n^T + k (D - L) / D (I - n n^T)} de
// A spring of no length has d2U = k I. Where D = 0 and L > 0 there is no direction: it
// neither pulls nor pushes there.
//
// Material damping. A loss of gain k / 2 (D - D_n)^2 in a step makes of it a spring of
// stiffness k (1 + gain) and length (L + gain D_n) / (1 + gain), but for a constant.
#include "solver/dynamics/distance_springs.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"

namespace cellwarp::core
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

Vector3d along(const PointShares& shares, const Eigen::VectorXd& x)
{
    Vector3d sum = Vector3d::Zero();
    for (const auto& [unknown, share] : shares)
        sum += share * x.segment<3>(unknown);
    return sum;
}

void pull(const PointShares& shares, const Vector3d& force, Eigen::VectorXd& out)
{
    for (const auto& [unknown, share] : shares)
        out.segment<3>(unknown) += share * force;
}

PointShares way_between(const PointShares& from, const PointShares& to)
{
    PointShares all = to;
    for (const auto& [unknown, share] : from)
        all.emplace_back(unknown, -share);
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    PointShares out;
    for (const auto& [unknown, share] : all)
        if (!out.empty() && out.back().first == unknown)
            out.back().second += share;
        else
            out.emplace_back(unknown, share);
    return out;
}

void DistanceSprings::add(DistanceSpring spring)
{
    Spring& one = springs_.emplace_back();
    static_cast<DistanceSpring&>(one) = std::move(spring);
    one.hard = one.stiffness;
    one.rest = one.length;
}

void DistanceSprings::set_stiffness(std::size_t spring, double stiffness)
{
    springs_[spring].stiffness = springs_[spring].hard = stiffness;
}

double DistanceSprings::stiffest() const
{
    double most = 0.0;
    for (const Spring& spring : springs_)
        most = std::max(most, spring.hard);
    return most;
}

double DistanceSprings::energy_with(const Eigen::VectorXd& x, double Spring::*stiffness,
                                    double Spring::*length) const
{
    double sum = 0.0;
    for (const Spring& spring : springs_)
    {
        const double longer = way(spring, x).norm() - spring.*length;
        sum += 0.5 * spring.*stiffness * longer * longer;
    }
    return sum;
}

double DistanceSprings::energy(const Eigen::VectorXd& x) const
{
    return energy_with(x, &Spring::stiffness, &Spring::length);
}

double DistanceSprings::step_energy(const Eigen::VectorXd& x) const
{
    return energy_with(x, &Spring::hard, &Spring::rest);
}

void DistanceSprings::damp(const Eigen::VectorXd& begin, double gain)
{
    for (Spring& spring : springs_)
    {
        spring.hard = (1.0 + gain) * spring.stiffness;
        spring.rest =
            gain > 0.0 ? (spring.length + gain * way(spring, begin).norm()) / (1.0 + gain)
                       : spring.length;
    }
}

double DistanceSprings::add_gradient(const Eigen::VectorXd& x, Eigen::VectorXd& out) const
{
    double largest = 0.0;
    for (const Spring& spring : springs_)
    {
        const Vector3d e = way(spring, x);
        const double D = e.norm();
        if (!(D > 0.0))
            continue;
        const double force = spring.hard * (D - spring.rest);
        largest = std::max(largest, std::abs(force));
        pull(spring.way, force / D * e, out);
    }
    return largest;
}

Matrix3d DistanceSprings::second_derivatives(const Spring& spring,
                                             const Eigen::VectorXd& x,
                                             Curvature how) const
{
    const Vector3d e = way(spring, x);
    const double D = e.norm();
    if (spring.rest == 0.0)
        return spring.hard * Matrix3d::Identity();
    const Vector3d n = D > 0.0 ? Vector3d(e / D) : Vector3d::UnitX();
    double force = is_predicted_ ? spring.force : spring.hard * (D - spring.rest);
    if (how == Curvature::WithoutPushes)
        force = std::max(force, 0.0);
    const double across = D > 0.0 ? force / D : 0.0;
    Matrix3d B = (spring.hard - across) * n * n.transpose();
    B.diagonal().array() += across;
    return B;
}

void DistanceSprings::predict(const Eigen::VectorXd& x, const Eigen::VectorXd* step)
{
    is_predicted_ = step != nullptr;
    if (!step)
        return;
    for (Spring& spring : springs_)
    {
        const Vector3d e = way(spring, x);
        const double D = e.norm();
        const double longer = D > 0.0 ? e.dot(along(spring.way, *step)) / D : 0.0;
        spring.force = spring.hard * (D + longer - spring.rest);
    }
}

void DistanceSprings::add_correction(const Eigen::VectorXd& before,
                                     const Eigen::VectorXd& after,
                                     const Eigen::VectorXd& step,
                                     Eigen::VectorXd& out) const
{
    for (const Spring& spring : springs_)
    {
        const Vector3d e = way(spring, before);
        const double D = e.norm();
        if (!(D > 0.0))
            continue;
        const Vector3d n = e / D;
        const double left =
            way(spring, after).norm() - D - n.dot(along(spring.way, step));
        pull(spring.way, -spring.hard * left * n, out);
    }
}

double DistanceSprings::turn(const Eigen::VectorXd& x, const Eigen::VectorXd& step) const
{
    double turn = 0.0;
    for (const Spring& spring : springs_)
    {
        if (spring.length == 0.0)
            continue; // it pulls in proportion to its length
        const Vector3d e = way(spring, x), change = along(spring.way, step);
        const double l = std::max(e.norm(), 0.1 * spring.length);
        turn = std::max(
            turn,
            (change - e * e.dot(change) / std::max(e.squaredNorm(), 1e-300)).norm() / l);
    }
    return turn;
}

} // namespace cellwarp::core
