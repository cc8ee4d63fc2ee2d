// SPDX-License-Identifier: GPL-3.0-or-later
// What is minimised is a sum of terms. Each is a function of one state or of several, and
// adds its value and its derivatives in their places.
#pragma once

#include <span>
#include <utility>

#include <Eigen/Core>

namespace cellwarp::core
{

/// How much of the second derivative: J^T J, which is positive semi-definite, plus a
/// share of the curvature of the residuals, which with 1 makes it exact.
struct Curvature
{
    double share;
};
inline constexpr Curvature kGaussNewton{0.0}, kExact{1.0};

/// A term of an energy: glue, inertia, gravity, a joint. Vectors are of all unknowns and
/// blocks are counted over all of them; derivatives are in the steps from the current
/// states. One object is a whole kind (all faces of glue, all rods): one call for all.
class Term
{
public:
    virtual ~Term() = default;

    /// Pairs (row, column) of blocks that it gives second derivatives, row > column,
    /// ascending, none twice.
    virtual std::span<const std::pair<int, int>> pairs() const = 0;

    virtual double value() const = 0;
    virtual void add_gradient(Eigen::VectorXd& out) const = 0;
    /// For each block what rounding of the states alone may leave of its gradient (norm).
    virtual void add_rounding(std::span<double> out) const = 0;

    /// Prepares the second derivatives at the current states for the functions below.
    virtual void linearise(Curvature curvature) = 0;
    /// y += H x. \p x and \p y are different vectors.
    virtual void add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const = 0;
    virtual void add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const = 0;
    /// \p pair: a place in pairs().
    virtual void add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const = 0;
};

} // namespace cellwarp::core
