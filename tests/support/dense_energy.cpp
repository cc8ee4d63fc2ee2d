// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/dense_energy.h"

#include <algorithm>
#include <limits>

namespace cellwarp::support
{

DenseEnergy::DenseEnergy(std::vector<int> sizes, const Eigen::VectorXd& x)
    : sizes_(std::move(sizes)), first_(1, 0), x_(x), base_(x)
{
    for (const int size : sizes_)
        first_.push_back(first_.back() + size);
    for (int row = 0; row < static_cast<int>(sizes_.size()); ++row)
        for (int column = 0; column < row; ++column)
            pairs_.emplace_back(row, column);
}

void DenseEnergy::rounding(std::span<double> out) const
{
    std::fill(out.begin(), out.end(),
              16.0 * std::numeric_limits<double>::epsilon() * (1.0 + x_.norm()));
}

void DenseEnergy::diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const std::size_t b = static_cast<std::size_t>(block);
    out = H_.block(first_[b], first_[b], sizes_[b], sizes_[b]);
}

void DenseEnergy::pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const auto [row, column] = pairs_[static_cast<std::size_t>(pair)];
    const std::size_t r = static_cast<std::size_t>(row);
    const std::size_t c = static_cast<std::size_t>(column);
    out = H_.block(first_[r], first_[c], sizes_[r], sizes_[c]);
}

Quadratic::Quadratic(std::vector<int> sizes, const Eigen::MatrixXd& A,
                     const Eigen::VectorXd& b)
    : DenseEnergy(std::move(sizes), Eigen::VectorXd::Zero(b.size())), A_(A), b_(b)
{
}

double Quadratic::value() const
{
    return 0.5 * x().dot(A_ * x()) - b_.dot(x());
}

Eigen::VectorXd Quadratic::gradient_at(const Eigen::VectorXd& x) const
{
    return A_ * x - b_;
}

Eigen::MatrixXd Quadratic::hessian_at(const Eigen::VectorXd&, Curvature) const
{
    return A_;
}

} // namespace cellwarp::support
