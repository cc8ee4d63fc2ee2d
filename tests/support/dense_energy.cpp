// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/dense_energy.h"

#include <limits>

#include "octree/base/index.h"

namespace cellwarp::core::support
{

DenseEnergy::Structure::Structure(std::vector<int> of) : sizes(std::move(of)), first(1, 0)
{
    for (const int size : sizes)
        first.push_back(first.back() + size);
    for (int row = 0; row < static_cast<int>(sizes.size()); ++row)
        for (int column = 0; column < row; ++column)
            pairs.emplace_back(row, column);
}

DenseEnergy::DenseEnergy(std::vector<int> sizes, const Eigen::VectorXd& x)
    : State({}), structure_(std::move(sizes)), x_(x), base_(x)
{
}

void DenseEnergy::add_rounding(std::span<double> out) const
{
    for (double& error : out)
        error += 16.0 * std::numeric_limits<double>::epsilon() * (1.0 + x_.norm());
}

void DenseEnergy::add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const auto& [sizes, first, pairs] = structure_;
    const std::size_t b = idx(block);
    out += H_.block(first[b], first[b], sizes[b], sizes[b]);
}

void DenseEnergy::add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const auto& [sizes, first, pairs] = structure_;
    const auto [row, column] = pairs[idx(pair)];
    const std::size_t r = idx(row);
    const std::size_t c = idx(column);
    out += H_.block(first[r], first[c], sizes[r], sizes[c]);
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

} // namespace cellwarp::core::support
