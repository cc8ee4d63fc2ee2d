// SPDX-License-Identifier: GPL-3.0-or-later
// A spring of length l between two points, along n, has the energy k / 2 (l - l_0)^2 and
// the second derivatives k [n n^T + (1 - l_0 / l) (1 - n n^T)]. What is pushed together
// has a negative part across n, which is left out where it makes the whole indefinite.
#include "solver/dynamics/spring_net.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "solver/linear/rounding.h"

namespace cellwarp
{

namespace
{

using Eigen::Vector3d;

} // namespace

SpringNet::SpringNet(std::vector<Vector3d> points, Eigen::VectorXd mass,
                     std::vector<NetSpring> springs)
    : mass_(std::move(mass)), springs_(std::move(springs)), is_fast_(points.size(), 0)
{
    x.resize(3 * static_cast<Eigen::Index>(points.size()));
    Vector3d low = points.front(), high = low;
    for (std::size_t k = 0; k < points.size(); ++k)
    {
        x.segment<3>(3 * static_cast<Eigen::Index>(k)) = points[k];
        low = low.cwiseMin(points[k]);
        high = high.cwiseMax(points[k]);
    }
    size_ = (high - low).norm();
    velocity = Eigen::VectorXd::Zero(x.size());
    for (NetSpring& spring : springs_)
    {
        spring.length = (point(spring.node[0]) - point(spring.node[1])).norm();
        stiffest_ = std::max(stiffest_, spring.stiffness);
    }
    start_ = trial_ = velocity_before_ = x;
    diagonal_ = Eigen::VectorXd::Zero(x.size());
}

double SpringNet::elastic(const Eigen::VectorXd& at) const
{
    double sum = 0.0;
    for (const NetSpring& spring : springs_)
    {
        const double l =
            (at.segment<3>(3 * spring.node[0]) - at.segment<3>(3 * spring.node[1]))
                .norm();
        sum += 0.5 * spring.stiffness * (l - spring.length) * (l - spring.length);
    }
    return sum;
}

double SpringNet::weight(const Eigen::VectorXd& at) const
{
    double sum = 0.0;
    for (int k = 0; k < num_points(); ++k)
        sum -= mass_[k] * gravity.dot(at.segment<3>(3 * k));
    return sum;
}

double SpringNet::kinetic() const
{
    double sum = 0.0;
    for (int k = 0; k < num_points(); ++k)
        sum += 0.5 * mass_[k] * velocity.segment<3>(3 * k).squaredNorm();
    return sum;
}

ArticulableObject::Energy SpringNet::energy() const
{
    const double moving = kinetic(), stretched = elastic(x);
    return {moving + stretched + weight(x), moving + stretched};
}

Vector3d SpringNet::place(int place, bool of_trial) const
{
    return (of_trial ? trial_ : x).segment<3>(3 * place);
}

void SpringNet::add_moved(int place, const Vector3d& n, SparseRow& out) const
{
    if (is_fast_[idx(place)])
        return;
    for (int c = 0; c < 3; ++c)
        out.emplace_back(3 * place + c, n[c]);
}

void SpringNet::start(double step)
{
    step_ = step;
    pull_ = 1.0 / (step * step) + viscosity / step;
    start_ = x;
    velocity_before_ = velocity;
}

void SpringNet::undo()
{
    x = start_;
    velocity = velocity_before_;
}

void SpringNet::measure(bool of_trial, Measure& out)
{
    const Eigen::VectorXd& at = of_trial ? trial_ : x;
    out.value = elastic(at) + weight(at);
    for (int k = 0; k < num_points(); ++k)
    {
        const Vector3d way = at.segment<3>(3 * k) - start_.segment<3>(3 * k);
        out.value += mass_[k] * (0.5 * pull_ * way.squaredNorm() -
                                 velocity_before_.segment<3>(3 * k).dot(way) / step_);
    }
}

void SpringNet::let_go_of_fast(Eigen::VectorXd& forces) const
{
    for (int k = 0; k < num_points(); ++k)
        if (is_fast_[idx(k)])
            forces.segment<3>(3 * k).setZero();
}

double SpringNet::linearise(Eigen::VectorXd& gradient, Measure&)
{
    gradient.setZero(x.size());
    double at_work = 0.0;
    for (int k = 0; k < num_points(); ++k)
        gradient.segment<3>(3 * k) =
            mass_[k] * (pull_ * (point(k) - start_.segment<3>(3 * k)) -
                        velocity_before_.segment<3>(3 * k) / step_ - gravity);
    at_work = std::max(gradient.cwiseAbs().maxCoeff(), mass_.maxCoeff() * gravity.norm());
    for (const NetSpring& spring : springs_)
    {
        const Vector3d way = point(spring.node[0]) - point(spring.node[1]);
        const double l = way.norm();
        if (!(l > 0.0))
            continue;
        const Vector3d force = spring.stiffness * (l - spring.length) / l * way;
        at_work = std::max(at_work, force.norm());
        gradient.segment<3>(3 * spring.node[0]) += force;
        gradient.segment<3>(3 * spring.node[1]) -= force;
    }
    let_go_of_fast(gradient);
    return at_work;
}

double SpringNet::noise_of_forces() const
{
    return 8.0 * kRounding * (stiffest_ + pull_ * mass_.maxCoeff()) * extent();
}

SaddleSolver::Report SpringNet::factorize(const Eigen::VectorXd&, int& level)
{
    std::vector<Eigen::Triplet<double>> entries;
    SaddleSolver::Report told;
    for (;; ++level)
    {
        entries.clear();
        for (int u = 0; u < x.size(); ++u)
            entries.emplace_back(u, u,
                                 is_fast_[idx(u / 3)]
                                     ? 1.0
                                     : std::pow(4.0, std::max(level - 1, 0)) * pull_ *
                                           mass_[u / 3]);
        for (const NetSpring& spring : springs_)
        {
            const Vector3d way = point(spring.node[0]) - point(spring.node[1]);
            const double l = way.norm();
            const Vector3d n = l > 0.0 ? Vector3d(way / l) : Vector3d::UnitX();
            const double tension = spring.length == 0.0 ? 1.0
                                   : l > 0.0            ? 1.0 - spring.length / l
                                   : level == 0         ? -1.0
                                                        : 0.0;
            const double across = level == 0 ? tension : std::max(tension, 0.0);
            const Eigen::Matrix3d K =
                spring.stiffness * (across * Eigen::Matrix3d::Identity() +
                                    (1.0 - across) * n * n.transpose());
            for (const int i : {0, 1})
                for (const int j : {0, 1})
                {
                    const int a = spring.node[idx(i)], b = spring.node[idx(j)];
                    const bool is_idle = is_fast_[idx(a)] || is_fast_[idx(b)];
                    for (int r = 0; r < 3; ++r)
                        for (int c = 0; c < 3; ++c)
                            if (3 * a + r >= 3 * b + c)
                                entries.emplace_back(3 * a + r, 3 * b + c,
                                                     is_idle && a != b ? 0.0
                                                     : is_fast_[idx(a)]
                                                         ? 0.0
                                                         : (i == j ? K(r, c) : -K(r, c)));
                }
        }
        matrix_.resize(x.size(), x.size());
        matrix_.setFromTriplets(entries.begin(), entries.end());
        if (!factor_)
        {
            factor_ =
                std::make_unique<Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>>();
            factor_->analyzePattern(matrix_);
        }
        factor_->factorize(matrix_);
        diagonal_ = matrix_.diagonal();
        told.is_finite = diagonal_.allFinite();
        told.num_negative = factor_->info() != Eigen::Success;
        if (told.is_finite && factor_->info() == Eigen::Success)
            told.num_negative =
                static_cast<int>((factor_->vectorD().array() <= 0.0).count());
        if (!told.is_finite || told.num_negative == 0 || level >= kMostLevel)
            return told;
    }
}

void SpringNet::solve(Eigen::VectorXd& r, Eigen::VectorXd&) const
{
    let_go_of_fast(r);
    r = factor_->solve(r);
}

/// Of the springs.
double SpringNet::turn(const Eigen::VectorXd& step) const
{
    double turn = 0.0;
    for (const NetSpring& spring : springs_)
    {
        if (spring.length == 0.0)
            continue; // it pulls in proportion to its length
        const Vector3d way = point(spring.node[0]) - point(spring.node[1]);
        const Vector3d change =
            step.segment<3>(3 * spring.node[0]) - step.segment<3>(3 * spring.node[1]);
        const double l = std::max(way.norm(), 0.1 * spring.length);
        turn = std::max(
            turn, (change - way * way.dot(change) / std::max(way.squaredNorm(), 1e-300))
                          .norm() /
                      l);
    }
    return turn;
}

void SpringNet::try_step(const Eigen::VectorXd& step, double length)
{
    trial_ = x + length * step;
}

/// What is left of a spring's length by its curvature along the step.
void SpringNet::add_correction(const Eigen::VectorXd& part, Eigen::VectorXd& out) const
{
    for (const NetSpring& spring : springs_)
    {
        const auto between = [&](const Eigen::VectorXd& at) -> Vector3d
        { return at.segment<3>(3 * spring.node[0]) - at.segment<3>(3 * spring.node[1]); };
        const Vector3d before = between(x);
        const double l = before.norm();
        if (!(l > 0.0))
            continue;
        const Vector3d n = before / l;
        const double left = between(trial_).norm() - l - n.dot(between(part));
        out.segment<3>(3 * spring.node[0]) -= spring.stiffness * left * n;
        out.segment<3>(3 * spring.node[1]) += spring.stiffness * left * n;
    }
    let_go_of_fast(out);
}

} // namespace cellwarp
