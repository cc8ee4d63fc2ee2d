// SPDX-License-Identifier: GPL-3.0-or-later
// Energies of a vector of numbers whose second derivatives are one full matrix: toys, to
// test solvers on what is known in closed form.
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/energy.h"

namespace cellwarp::support
{

/// The state is the vector; a step is added to it. Every block is coupled to every other.
class DenseEnergy : public Energy
{
public:
    DenseEnergy(std::vector<int> sizes, const Eigen::VectorXd& x);

    const Eigen::VectorXd& x() const { return x_; }
    const Eigen::MatrixXd& hessian() const { return H_; }
    void set_x(const Eigen::VectorXd& x) { x_ = base_ = x; }

    std::span<const int> block_sizes() const override { return sizes_; }
    std::span<const std::pair<int, int>> pairs() const override { return pairs_; }
    void gradient(Eigen::VectorXd& out) const override { out = gradient_at(x_); }
    void rounding(std::span<double> out) const override;
    void linearise(Curvature curvature) override { H_ = hessian_at(x_, curvature); }
    void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override
    {
        y.noalias() = H_ * x;
    }
    void diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void move(const Eigen::VectorXd& step, double length) override
    {
        x_ = base_ + length * step;
    }
    void settle() override { base_ = x_; }

protected:
    virtual Eigen::VectorXd gradient_at(const Eigen::VectorXd& x) const = 0;
    virtual Eigen::MatrixXd hessian_at(const Eigen::VectorXd& x,
                                       Curvature curvature) const = 0;

private:
    std::vector<int> sizes_, first_;
    std::vector<std::pair<int, int>> pairs_;
    Eigen::VectorXd x_, base_;
    Eigen::MatrixXd H_;
};

/// 1/2 x^T A x - b^T x
class Quadratic final : public DenseEnergy
{
public:
    Quadratic(std::vector<int> sizes, const Eigen::MatrixXd& A, const Eigen::VectorXd& b);
    double value() const override;

protected:
    Eigen::VectorXd gradient_at(const Eigen::VectorXd& x) const override;
    Eigen::MatrixXd hessian_at(const Eigen::VectorXd& x, Curvature) const override;

private:
    Eigen::MatrixXd A_;
    Eigen::VectorXd b_;
};

/// z = M^-1 r with a given M^-1.
class DensePreconditioner final : public Preconditioner
{
public:
    explicit DensePreconditioner(const Eigen::MatrixXd& inverse) : inverse_(inverse) {}
    void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) override
    {
        z.noalias() = inverse_ * r;
    }

private:
    Eigen::MatrixXd inverse_;
};

} // namespace cellwarp::support
