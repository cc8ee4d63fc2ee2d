// SPDX-License-Identifier: GPL-3.0-or-later
// What a linear solver needs to know of a matrix that nobody has to write down.
#pragma once

#include <span>
#include <utility>

#include <Eigen/Core>

namespace cellwarp::core
{

/// A symmetric matrix H, as what it does to a vector.
class LinearOperator
{
public:
    virtual ~LinearOperator() = default;
    /// y = H x. \p x and \p y are different vectors.
    virtual void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const = 0;
};

/// One whose blocks can be asked for: what is factorised, and what preconditioners are
/// made from.
class BlockOperator : public LinearOperator
{
public:
    /// Of the diagonal blocks.
    virtual std::span<const int> block_sizes() const = 0;
    /// Places (row, column) of the other blocks that are not zero, row > column,
    /// ascending, none twice.
    virtual std::span<const std::pair<int, int>> pairs() const = 0;
    virtual void diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const = 0;
    virtual void pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const = 0;
};

/// z = M^-1 r, with M symmetric, positive definite and near the matrix to be inverted.
class Preconditioner
{
public:
    virtual ~Preconditioner() = default;
    virtual void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) = 0;
    /// Made anew for the matrix as it is now. May do nothing.
    virtual void refresh() {}
};

} // namespace cellwarp::core
