// SPDX-License-Identifier: GPL-3.0-or-later
// What a minimiser needs to know of an energy and its state: the one interface for
// cells, rods and whatever else is solved for.
#pragma once

#include <span>
#include <utility>

#include <Eigen/Core>

namespace cellwarp
{

/// How much of the second derivative: J^T J, which is positive semi-definite, plus a
/// share of the curvature of the residuals, which with 1 makes it exact.
struct Curvature
{
    double share;
};
inline constexpr Curvature kGaussNewton{0.0}, kExact{1.0};

/// An energy as a function of its own state. A state is changed by steps: vectors of
/// blocks of any size (a free cell has 6 unknowns, a pinned cell 3, a control point 3, an
/// angle 1). How a step moves a state, along rotations too, is the energy's business;
/// derivatives are in the steps from the current state.
class Energy
{
public:
    virtual ~Energy() = default;

    virtual std::span<const int> block_sizes() const = 0;
    /// Pairs (row, column) of blocks that have second derivatives, row > column,
    /// ascending, none twice.
    virtual std::span<const std::pair<int, int>> pairs() const = 0;

    virtual double value() const = 0;
    virtual void gradient(Eigen::VectorXd& out) const = 0;
    /// For each block what rounding of the state alone may leave of its gradient (norm).
    virtual void rounding(std::span<double> out) const = 0;

    /// Prepares the second derivatives at the current state for the functions below.
    virtual void linearise(Curvature curvature) = 0;
    /// y = H x. \p x and \p y are different vectors.
    virtual void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const = 0;
    virtual void diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const = 0;
    virtual void pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const = 0;

    /// Current state = base state, moved by length times step.
    virtual void move(const Eigen::VectorXd& step, double length) = 0;
    /// Makes the current state the base of the next steps.
    virtual void settle() = 0;
};

/// z = M^-1 r, with M symmetric, positive definite and near the Hessian of an energy.
class Preconditioner
{
public:
    virtual ~Preconditioner() = default;
    virtual void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) = 0;
    /// Made anew for the current state of the energy, linearised without curvature. May
    /// do nothing.
    virtual void refresh() {}
};

} // namespace cellwarp
