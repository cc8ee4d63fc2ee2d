// SPDX-License-Identifier: GPL-3.0-or-later
// Springs that are pushed together have a negative part across, left out where it makes
// the whole indefinite.
#include "solver/dynamics/spring_net.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

} // namespace

SpringNet::SpringNet(std::vector<Vector3d> points, Eigen::VectorXd mass,
                     const std::vector<NetSpring>& springs)
    : is_fast_(points.size(), 0)
{
    Eigen::VectorXd at(3 * static_cast<Eigen::Index>(points.size()));
    Vector3d low = points.front(), high = low;
    for (std::size_t k = 0; k < points.size(); ++k)
    {
        at.segment<3>(3 * static_cast<Eigen::Index>(k)) = points[k];
        low = low.cwiseMin(points[k]);
        high = high.cwiseMax(points[k]);
    }
    size_ = (high - low).norm();
    stand_at(std::move(at));
    weights_ = std::move(mass);
    for (const NetSpring& spring : springs)
    {
        const auto [a, b] = std::minmax(spring.node[0], spring.node[1]);
        springs_.add({{{3 * a, -1.0}, {3 * b, 1.0}},
                      spring.stiffness,
                      (point(a) - point(b)).norm()});
    }
    diagonal_ = Eigen::VectorXd::Zero(x.size());
}

double SpringNet::kinetic() const
{
    double sum = 0.0;
    for (int k = 0; k < num_points(); ++k)
        sum += 0.5 * weights_[k] * velocity.segment<3>(3 * k).squaredNorm();
    return sum;
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

void SpringNet::measure(bool of_trial, Measure& out)
{
    const Eigen::VectorXd& at = of_trial ? trial_ : x;
    out.value = springs_.step_energy(at) + weight(at);
    for (int k = 0; k < num_points(); ++k)
    {
        const Vector3d way = at.segment<3>(3 * k) - start_.segment<3>(3 * k);
        out.value += weights_[k] * (0.5 * pull_ * way.squaredNorm() -
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
            weights_[k] * (pull_ * (point(k) - start_.segment<3>(3 * k)) -
                           velocity_before_.segment<3>(3 * k) / step_ - gravity);
    at_work =
        std::max(gradient.cwiseAbs().maxCoeff(), weights_.maxCoeff() * gravity.norm());
    at_work = std::max(at_work, springs_.add_gradient(x, gradient));
    let_go_of_fast(gradient);
    return at_work;
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
                                           weights_[u / 3]);
        springs_.for_each_block(
            x,
            level == 0 ? DistanceSprings::Curvature::Exact
                       : DistanceSprings::Curvature::WithoutPushes,
            [&](int row, int column, const Eigen::Matrix3d& B)
            {
                // Entries that stay keep their places in the pattern.
                const double share =
                    is_fast_[idx(row / 3)] || is_fast_[idx(column / 3)] ? 0.0 : 1.0;
                for (int r = 0; r < 3; ++r)
                    for (int c = 0; c < 3; ++c)
                        if (row + r >= column + c)
                            entries.emplace_back(row + r, column + c, share * B(r, c));
            });
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

void SpringNet::add_correction(const Eigen::VectorXd& part, Eigen::VectorXd& out) const
{
    SpringObject::add_correction(part, out);
    let_go_of_fast(out);
}

} // namespace cellwarp::core
