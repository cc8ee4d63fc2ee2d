// SPDX-License-Identifier: GPL-3.0-or-later
// Energies of a vector of numbers whose second derivatives are one full matrix: toys, to
// test solvers on what is known in closed form.
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/minimize/energy.h"

namespace cellwarp::core::support
{

/// The state is the vector; a step is added to it. Every block is coupled to every other.
class DenseEnergy : public State, public Term
{
public:
    DenseEnergy(std::vector<int> sizes, const Eigen::VectorXd& x);
    DenseEnergy(const DenseEnergy&) = delete;
    DenseEnergy& operator=(const DenseEnergy&) = delete;

    const Eigen::VectorXd& x() const { return x_; }
    const Eigen::MatrixXd& hessian() const { return H_; }
    void set_x(const Eigen::VectorXd& x) { x_ = base_ = x; }

    std::span<const int> block_sizes() const override { return structure_.sizes; }
    std::span<const std::pair<int, int>> pairs() const override
    {
        return structure_.pairs;
    }
    void add_gradient(Eigen::VectorXd& out) const override { out += gradient_at(x_); }
    void add_rounding(std::span<double> out) const override;
    void linearise(Curvature curvature) override { H_ = hessian_at(x_, curvature); }
    void add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override
    {
        y.noalias() += H_ * x;
    }
    void add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void move(const Eigen::VectorXd& step, double length) override
    {
        x_ = base_ + length * step;
    }
    void settle() override { base_ = x_; }
    double largest_move() const override
    {
        return (x_ - base_).lpNorm<Eigen::Infinity>();
    }

protected:
    virtual Eigen::VectorXd gradient_at(const Eigen::VectorXd& x) const = 0;
    virtual Eigen::MatrixXd hessian_at(const Eigen::VectorXd& x,
                                       Curvature curvature) const = 0;

private:
    struct Structure
    {
        std::vector<int> sizes, first;
        std::vector<std::pair<int, int>> pairs;

        explicit Structure(std::vector<int> of);
    } structure_;

public:
    Energy total{{this}, {this}}; ///< this term alone, of this state alone

private:
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

} // namespace cellwarp::core::support
